// Every constant of the gap diagnosis on which an answer depends: what it means, its unit (in the name), why it has
// this value. docs/options.md has a table of how much the answers change when each is halved and doubled, and the
// command that makes it.
//
// Units: _samples; _s; _fraction of what the comment names; _tolerances of the datasheet's parameters; _sigma:
// standard deviations of the noise, or of what the comment names; _variances: noise variances; _log_likelihood:
// natural logarithm. Numbers without a unit count. "Development" in a comment: chosen on the cases of the development
// seed of test/withheld, no derivation. Not here: what a user sets (GapSettings), plain mathematics, guards against
// division by zero.
#pragma once

#include <array>
#include <cstddef>
#include <string>

#include "faultline/attribution/candidates.h"
#include "faultline/segments/segment_options.h"

namespace faultline {

struct GapOptions {
  GapOptions() { segments.long_steps = segments.beside = true; }

  SegmentOptions segments;

  // linearisation.h: loss, sensitivities, parameters to first order.
  struct Linearisation {
    // Step of the differences by a parameter: large against rounding, small against the prior.
    double difference_tolerances = 0.1;
    // Bound of a parameter's deviation: beyond 3.5 standard deviations the datasheet is wrong, not the rig.
    double parameter_bound_tolerances = 3.5;
    // Least noise variance of a segment as a fraction of the recording's: a segment cannot be better than its noise;
    // a fifth leaves room for a noise estimate that is too large.
    double least_variance_fraction = 0.2;
    // Steps of the bounded solve: each holds a parameter at its bound or lets one go; few are held at all.
    std::size_t bound_steps = 40;
    // Reweighted Gauss-Newton steps of a loss to first order; the weights have converged by then.
    std::size_t reweightings = 4;
  } linearisation;

  // fit_gap.h: damped Gauss-Newton. Coordinates run from 0 to 1 over an effect's range.
  struct Fit {
    double difference_coordinate =
        2e-3;  // step of the differences by an effect's size: above rounding, below curvature
    double largest_step_coordinate = 0.34;  // of one step: a third of the range, as far as a derivative may be believed
    double tangent_ratio = 3;               // change of a logarithmic size up to which a step follows the tangent
    std::size_t attempts = 5;               // of one step, each more damped, or half as long ...
    std::size_t corrections = 3;            // ... and led back into the valley so often, at most
    double ridge_step_tolerances = 0.25;    // by which the response along a ridge is measured ...
    double ridge_step_coordinate = 0.1;     // ... in a size's coordinate so much of that: short against its bends
    double damping_decrease_ratio = 0.2;    // of the damping (Levenberg, Marquardt) after a step that is taken ...
    double damping_increase_ratio = 8;      // ... and after one that is refused,
    double damping_first = 0.1;             // but at least this, relative to the Hessian's diagonal
    double settled_log_likelihood =
        0.5;  // gain of a step below which the fit has converged: no decision rests on so little
    double polished_log_likelihood =
        0.05;  // ... of the model that is told: less moves no size by a standard deviation's third
  } fit;

  CandidateOptions candidates;

  // spectral_lines.h.
  struct Spectrum {
    std::size_t padding_ratio = 4;  // length of the transform over that of the longest run: grid points per line
    std::size_t neighbour_grid_points = 64;  // on each side, whose median is a line's background
    std::size_t lines = 5;                   // what flips sign with another signal has side bands stronger than itself
    double line_half_width_resolutions = 0.5;  // range left to a frequency around a line, in units of 1/duration
    double line_distance_resolutions = 3;      // between lines, in the same: side lobes of the window are none
    double rarity_log_likelihood = 11;  // -ln of the probability that noise makes a line: 1.7e-5 of the grid points
    // Of what phases of each run's own win, from which on one phase is as good (run_phases.h): what is fitted to each
    // run always wins a little more.
    double one_phase_fraction = 0.95;
  } spectrum;

  // screening.h.
  struct Screening {
    // Range of the fraction of a starting point's size at which its effect is judged to first order.
    double least_size_fraction = 0.05, largest_size_fraction = 2.5;
    std::size_t first_stride = 3;          // one starting point of so many of each candidate is tried first ...
    std::size_t followed_candidates = 15;  // ... and all of those of so many candidates afterwards: bounds the effort
  } screening;

  // gap_trials.h: fits of structures.
  struct Trials {
    // Length over which the samples of a misfit say the same, as a fraction of a segment: about the correlation length
    // of a residual that is not white (development).
    double correlated_fraction = 0.08;
    std::size_t steps = 4;                // Gauss-Newton steps around one linearisation
    std::size_t quick_steps = 8;          // ... of a finalist, at most: few need more than six to converge
    std::size_t refit_rounds = 5;         // linearisations of the refit, at most
    std::size_t other_starts = 4;         // ... beside the datasheet's values, where these leave something
    double other_start_tolerances = 1.5;  // standard deviation of those
    std::size_t refine_rounds = 6;        // ... and of a structure that is followed
    // Segments of all runs on which causes are sought, in pieces of neighbours; of one run at least; and the fraction
    // of all above which all are taken.
    std::size_t part_segments = 64, part_piece_segments = 4, part_least_segments = 12;
    double part_worthwhile_fraction = 0.7;
    // Of a size's response, that parameters do not make up for, below which it may be on a ridge: forward differences
    // leave 0.02 of one that is (development).
    double ridge_part_fraction = 0.04;
    std::size_t polish_rounds = 3;  // linearisations of the model that is told, at most
    std::size_t whole_rounds = 2;   // linearisations on all segments of what was followed on a part, at most
    // Move up to which sensitivities stay valid: of a parameter in tolerances, of an effect as a fraction of its size.
    double same_sensitivity_fraction = 0.35;
    double same_closely_fraction = 0.03;  // ... the same where they are as exact as central differences
    // Information about an effect's size, as a fraction of that of all runs, below which a fold does not fit it.
    double shown_information_fraction = 0.1;
    double relinearise_log_likelihood =
        100;  // gain of a round that is worth another linearisation, or of a search (development)
    // ... and of a structure, as a fraction of what it has won: half of what rivals must differ by.
    double settled_gain_fraction = 0.01;
    double wide_span_coordinate =
        0.5;  // range on both sides of an effect's size that is searched where derivatives fail ...
    std::size_t wide_points = 15;         // ... and the values tried in it before the best is narrowed down
    double close_span_coordinate = 0.22;  // the same for the few structures that are followed
    std::size_t close_points = 9;
    std::size_t stuck_points = 3;  // values tried around a time from which a signal is stuck
    std::size_t searches = 2;      // of a structure that is followed, at most
    double search_excess_variances =
        0.04;  // excess of a typical segment below which no search is made: as quiet as a healthy rig
    double promising_gain_fraction = 0.25;  // of the best screening's gain, below which a finalist is not searched
  } trials;

  // effect_search.h: which effects are kept.
  struct Search {
    std::size_t finalists = 10;           // candidates that are fitted after screening
    std::size_t followed = 5;             // ... and that are refined, at most
    double followed_gain_fraction = 0.5;  // of the best quick gain, from which a finalist is refined
    // Of the most that a finalist wins once it has sensitivities of its own, what others must win to be followed on.
    double kept_gain_fraction = 0.6;
    // ... and to be followed over all segments, where causes are sought on a part: less is no rival.
    double whole_gain_fraction = 0.85;
    // By which the held-out gain of an effect must exceed 0. Of a gain that is nowhere negative: ten log-likelihoods,
    // if samples of a misfit that say the same count once (trials.correlated_fraction); odds of 100 to 1 among the 237
    // candidates of the largest rig here.
    double significance_standard_errors = 2.25;
    // Of the log likelihood that a perfect model would still win, what an effect must win to be taken ...
    double evidence_fraction = 0.08;
    // ... and a further one of what those before it won: what one leaves because it is not quite what the rig has is
    // small against what it explains (development).
    double further_evidence_fraction = 0.03;
    // Of what effects found leave on segments that no fit saw, what a further one must close (development, at random,
    // three rigs: of 6 that closed less 1 was in the truth, of 23 that closed more 11, most others by its nature).
    double further_closed_fraction = 0.25;
    // ... or of what they leave in one output, if it acts in the equations: of a rig of many branches with small causes
    // in all of them, a cause in one closes little of all (development, the cooling circuit).
    double further_output_closed_fraction = 0.75;
    // Of what an effect wins, what the noise of measured inputs may give: twice as much is the rig's.
    double input_noise_fraction = 0.34;
    // How long a signal at a transducer may remember to be its noise: a drift does as long as can be told.
    double noise_memory_segments = 4;
    // ... and how large it may be, over the white part (development: what is larger was no noise).
    double noise_level_ratio = 5;
    // Times the datasheet's range of a size, counted from no effect, to which one at the end of that range is followed.
    double beyond_range_ratio = 4;
    // What a free signal must win for a search, of what a perfect model would win ...
    double least_free_fraction = 0.02;
    // ... and of what the effects found have won or of what is left, whichever is less, for another.
    double further_free_fraction = 0.1;
    double close_rival_gain_fraction =
        0.03;  // of an effect's gain that a rival may be behind to be tried again beside the others
  } search;

  // diagnose_gap.h, step 6.
  struct Nearer {
    std::size_t at_bounds = 2;    // parameters of a model: a rig of which so many lie there is rare
    double bound_tolerances = 2;  // of all parameters then
    // The same once more where so many lie there, too, or no cause was found: two thirds of all parameters lie within.
    double nearest_tolerances = 1;
    // Of what is left beside causes, told with one more and without, or with others: parameters took its place.
    double left_ratio = 1.1;
    double better_ratio = 0.5;  // ... of others that leave much less, wherever the parameters lie
    // What tolerances say less against the parameters beside causes that let them go back: odds of 600 to 1 among the
    // 237 candidates of the largest rig here.
    double relief_log_likelihood = 12;
    double shrink_fraction = 0.3;  // that such causes close of the small gap that is left between nearer bounds
  } nearer;

  // diagnose_gap.h, step 9.
  struct Shorter {
    std::size_t times = 4;           // that a segment is cut into
    std::size_t least_samples = 20;  // of such a part: fewer hold little more than the start states take
  } shorter;

  // diagnose_gap.h, step 7.
  struct SlowDrift {
    std::size_t most_joined = 8;      // segments that are held together,
    std::size_t least_segments = 20;  // of which so many must be left
    double standard_errors = 5;       // by which readings leave the integral of their rate ...
    double agreement_fraction = 0.3;  // ... and of that rate, by which the drift that is fitted may differ
    // Of the log likelihood that a perfect model would win, what a drift must, which is the only one that is asked.
    double evidence_fraction = 0.03;
  } slow_drift;

  // run_agreement.h: whether the runs are of one rig.
  struct Agreement {
    double gain_fraction = 0.5;           // of what the model leaves that parameters of each run's own must win,
    double least_excess_variances = 0.1;  // but at least this: less is the scatter of what is never modelled
    std::size_t rounds = 4;               // linearisations of a run's own parameters, at most,
    double settled_gain_fraction = 0.1;   // ... until one gains less of what all have
    double apart_standard_errors = 5;     // between a parameter's values in two runs,
    double apart_tolerances = 1;          // but at least this: less is what an effect that is missing bends
  } agreement;

  // onset.h: since when.
  struct Onset {
    std::size_t least_segments = 6;   // before and after, that parameters of their own may be fitted to
    std::size_t inside_segments = 3;  // from an end of its run, that an onset lies: nearer it is the runs that differ
    double least_step_variances = 0.05;  // of a segment, by which two that are alike may differ
    std::size_t rounds = 4;              // linearisations, at most,
    double settled_tolerances = 0.3;     // ... until the parameters move less
    double before_fraction = 0.25;       // of the excess that follows, which the model may leave before
    double shown_fraction =
        0.1;  // of the information about parameters that a segment holds later, and must hold before
    double least_excess_variances = 0.1;  // that follows: less is the scatter of what is never modelled
    // Of the excess that follows, what parameters of all runs may leave where nothing began. A cause of which they took
    // the place leaves as much before as parameters of before leave later, for as long as that lasted.
    double explained_fraction = 0.03;
    // Left of the tolerances by what was before: the model is always a little wrong.
    double tolerance_fraction = 0.05;
    // Uncertainty of a parameter that is left by what was before, in tolerances, from which it keeps its own. From less
    // on, those would that are known in their combinations only, and take the place of causes.
    double untold_tolerances = 0.9;
    double contradicted_fraction = 0.1;  // OnsetSearch::contradicted(), from which a cause was not there before
  } onset;

  // diagnose_gap.h: the verdict.
  struct Verdict {
    // Excess of a healthy rig at the datasheet's noise: what small unmodelled things leave (development) ...
    double quiet_excess_variances = 0.05;
    // ... and the fraction of it that does not fall with the recording's noise.
    double quiet_noisy_fraction = 0.2;
    // Of the log likelihood that a perfect model would win, what named effects must win ...
    double material_evidence_fraction = 0.1;
    // ... and of the refit's excess, what they must close: what wins less is told by nobody as a cause.
    double material_shrink_fraction = 0.1;
    // ... of a gap that is too small to need a cause or smaller than the noise: five such names on rigs of another
    // author were wrong and closed 0.34 and less, the right ones closed 0.47 and more.
    double small_gap_shrink_fraction = 0.4;
    // ... of a large one, of all or of a typical segment: two wrong names closed 0.47 and 0.46 at most, the right ones
    // of the same truths 0.65 and more, one on measured data 0.54.
    double named_shrink_fraction = 0.5;
    // ... or of what the refit leaves in one output, where the rig has much else that is not modelled.
    double named_output_shrink_fraction = 0.75;
    // ... unless others are worse by more than this fraction of what is closed: one wrong name's are by 0.15.
    double shifted_fraction = 0.1;
    // ... where the likelihood says too much of an effect: half.
    double hidden_shrink_fraction = 0.5;
    // ... and from which they have closed it, where no more is left than a healthy rig has.
    double closed_shrink_fraction = 0.9;
    // ... or, whatever is left, since rigs have small things beside a cause: of a typical segment, too, or of what
    // restarts hide.
    double nearly_closed_fraction = 0.95;
    // ... or of a gap of which less is left than this: a free signal that wins more there wins it from half the noise.
    double little_left_variances = 0.25;
    double little_left_shrink_fraction = 0.75;
    // Of the gap from which there must be a cause, from which one that stands out is named.
    double named_matters_fraction = 0.1;
    // Of what named effects win, what a free signal at one place may still win beside them (development), if it is no
    // less than place_evidence_fraction ...
    double free_evidence_fraction = 0.25;
    // ... or than this: where everything is far from perfect, a tenth of that is not little. Five wrong names, four of
    // them beside a cause that was withheld, left 700 to 7000 and more than a quarter of what they won, no right one of
    // 24 more than a fifth; on few readings, the measured tanks, 60 and 120 withdraw no name.
    double beside_log_likelihood = 500;
    // Standard deviation of an effect's size from part to part of the runs, over its size, from which it is no cause
    // (size_agreement.h): 31 sizes of what a rig has differ by 0.04 and less, 19 beside a wrong name by up to 0.22.
    double size_spread = 0.25;
    // Of what a perfect model would win, what effects must win to be told as a part of an unknown cause ...
    double partial_evidence_fraction = 0.2;
    // ... and what a free signal at one place must win to speak of one where no effect was found (development) ...
    double place_evidence_fraction = 0.1;
    // ... and per reading: 4 % off the squared error from sample to sample, where a rig that is its datasheet's model
    // has 0.2 % (development) ...
    double place_log_likelihood = 0.02;
    // ... in a gap as large as the noise.
    double material_excess_variances = 1;
    // What no place explains is no silence either where it is as large as this, over what a gap must have to matter,
    // and this large against the noise: a structure that fits leaves less (development: 26 rigs in order left 2.9 at
    // most, three with a cause that no place explains 4.6 to 6.9).
    double silent_matters_ratio = 5;
    double silent_excess_variances = 4;
    double miscalibrated_excess_variances =
        0.05;                           // that the refit must remove to speak of miscalibration: the quiet excess
    double doubt_steepness = 4;         // of the logistic curve from doubt to probability
    double rival_standard_errors = 2;   // within which a rival cannot be told apart: 95 %
    double rival_gain_fraction = 0.02;  // ... or within this fraction of the gain
    double interval_ratio = 4;  // of an interval to what the fit's covariance says: it ignores what the model lacks
    double few_segments = 16;   // to learn from, below which the answer says so
    double place_probability = 0.15;  // of a second place, from which it is told as inseparable
    // Distance from an end of a parameter's range, in its coordinate, up to which its value is told to be at the bound.
    double bound_coordinate = 1e-3;
    std::size_t bootstraps = 400;  // of the shrink's interval: its ends then scatter by 5 % of its width
  } verdict;

  // measure.h: regions of the operating range.
  struct Regions {
    double standstill_fraction = 0.02;  // of a channel's 95 % range: near zero
    double notable_ratio = 1.25;        // enrichment from which a region is told
    double least_fraction = 0.01;       // of the samples, below which a region says nothing
    std::size_t most = 6;               // regions told
    std::size_t quantile_stride = 7;    // samples from one to the next that quantiles of a channel rest on: saves time
  } regions;

  // rounded_channels.h.
  struct Grid {
    std::size_t least_levels = 8;  // fewer distinct values name no grid
    // Of the noise's variance, what rounding must make up: it then lifts the noise by a fifth.
    double least_noise_fraction = 0.3;
    double half_width_fraction = 1e-3;  // of a step: half width of its interval, and how far it may differ between runs
  } grid;

  // next_run.h.
  struct NextRuns {
    // Length of a run that is proposed, at most; else the profile's own: enough to tell two causes apart that can be.
    double segments = 80;
    double least_segments = 4;              // ... and at least: fewer decide nothing
    double separating_log_likelihood = 20;  // between two causes, from which a run separates them: odds of 5e8
    std::size_t most = 3;                   // runs told
  } next_runs;
};

// Calls visit(name, value) for every option, so that a study or a test sees all: value is a double, a count, or an
// array of those.
template <class Visit>
void for_each_option(GapOptions& options, Visit&& visit) {
  for_each_option(options.segments,
                  [&](const char* name, auto& value) { visit((std::string("segments.") + name).c_str(), value); });
#define FAULTLINE_OPTION(member) visit(#member, options.member)
  FAULTLINE_OPTION(linearisation.difference_tolerances);
  FAULTLINE_OPTION(linearisation.parameter_bound_tolerances);
  FAULTLINE_OPTION(linearisation.least_variance_fraction);
  FAULTLINE_OPTION(linearisation.bound_steps);
  FAULTLINE_OPTION(linearisation.reweightings);
  FAULTLINE_OPTION(fit.difference_coordinate);
  FAULTLINE_OPTION(fit.largest_step_coordinate);
  FAULTLINE_OPTION(fit.tangent_ratio);
  FAULTLINE_OPTION(fit.attempts);
  FAULTLINE_OPTION(fit.corrections);
  FAULTLINE_OPTION(fit.ridge_step_tolerances);
  FAULTLINE_OPTION(fit.ridge_step_coordinate);
  FAULTLINE_OPTION(fit.damping_decrease_ratio);
  FAULTLINE_OPTION(fit.damping_increase_ratio);
  FAULTLINE_OPTION(fit.damping_first);
  FAULTLINE_OPTION(fit.settled_log_likelihood);
  FAULTLINE_OPTION(fit.polished_log_likelihood);
  FAULTLINE_OPTION(candidates.logarithmic_ratio);
  FAULTLINE_OPTION(candidates.shape_coordinates);
  FAULTLINE_OPTION(candidates.logarithmic_coordinates);
  FAULTLINE_OPTION(candidates.size_fractions);
  FAULTLINE_OPTION(candidates.stuck_times);
  FAULTLINE_OPTION(spectrum.padding_ratio);
  FAULTLINE_OPTION(spectrum.neighbour_grid_points);
  FAULTLINE_OPTION(spectrum.lines);
  FAULTLINE_OPTION(spectrum.line_half_width_resolutions);
  FAULTLINE_OPTION(spectrum.line_distance_resolutions);
  FAULTLINE_OPTION(spectrum.rarity_log_likelihood);
  FAULTLINE_OPTION(spectrum.one_phase_fraction);
  FAULTLINE_OPTION(screening.least_size_fraction);
  FAULTLINE_OPTION(screening.largest_size_fraction);
  FAULTLINE_OPTION(screening.first_stride);
  FAULTLINE_OPTION(screening.followed_candidates);
  FAULTLINE_OPTION(trials.correlated_fraction);
  FAULTLINE_OPTION(trials.steps);
  FAULTLINE_OPTION(trials.quick_steps);
  FAULTLINE_OPTION(trials.refit_rounds);
  FAULTLINE_OPTION(trials.other_starts);
  FAULTLINE_OPTION(trials.other_start_tolerances);
  FAULTLINE_OPTION(trials.refine_rounds);
  FAULTLINE_OPTION(trials.part_segments);
  FAULTLINE_OPTION(trials.part_piece_segments);
  FAULTLINE_OPTION(trials.part_least_segments);
  FAULTLINE_OPTION(trials.part_worthwhile_fraction);
  FAULTLINE_OPTION(trials.ridge_part_fraction);
  FAULTLINE_OPTION(trials.polish_rounds);
  FAULTLINE_OPTION(trials.whole_rounds);
  FAULTLINE_OPTION(trials.same_sensitivity_fraction);
  FAULTLINE_OPTION(trials.same_closely_fraction);
  FAULTLINE_OPTION(trials.shown_information_fraction);
  FAULTLINE_OPTION(trials.relinearise_log_likelihood);
  FAULTLINE_OPTION(trials.settled_gain_fraction);
  FAULTLINE_OPTION(trials.wide_span_coordinate);
  FAULTLINE_OPTION(trials.wide_points);
  FAULTLINE_OPTION(trials.close_span_coordinate);
  FAULTLINE_OPTION(trials.close_points);
  FAULTLINE_OPTION(trials.stuck_points);
  FAULTLINE_OPTION(trials.searches);
  FAULTLINE_OPTION(trials.search_excess_variances);
  FAULTLINE_OPTION(trials.promising_gain_fraction);
  FAULTLINE_OPTION(search.finalists);
  FAULTLINE_OPTION(search.followed);
  FAULTLINE_OPTION(search.followed_gain_fraction);
  FAULTLINE_OPTION(search.kept_gain_fraction);
  FAULTLINE_OPTION(search.whole_gain_fraction);
  FAULTLINE_OPTION(search.significance_standard_errors);
  FAULTLINE_OPTION(search.evidence_fraction);
  FAULTLINE_OPTION(search.further_evidence_fraction);
  FAULTLINE_OPTION(search.further_closed_fraction);
  FAULTLINE_OPTION(search.further_output_closed_fraction);
  FAULTLINE_OPTION(search.input_noise_fraction);
  FAULTLINE_OPTION(search.noise_memory_segments);
  FAULTLINE_OPTION(search.noise_level_ratio);
  FAULTLINE_OPTION(search.beyond_range_ratio);
  FAULTLINE_OPTION(search.least_free_fraction);
  FAULTLINE_OPTION(search.further_free_fraction);
  FAULTLINE_OPTION(search.close_rival_gain_fraction);
  FAULTLINE_OPTION(nearer.at_bounds);
  FAULTLINE_OPTION(nearer.nearest_tolerances);
  FAULTLINE_OPTION(nearer.bound_tolerances);
  FAULTLINE_OPTION(nearer.left_ratio);
  FAULTLINE_OPTION(nearer.better_ratio);
  FAULTLINE_OPTION(nearer.relief_log_likelihood);
  FAULTLINE_OPTION(nearer.shrink_fraction);
  FAULTLINE_OPTION(shorter.times);
  FAULTLINE_OPTION(shorter.least_samples);
  FAULTLINE_OPTION(slow_drift.most_joined);
  FAULTLINE_OPTION(slow_drift.least_segments);
  FAULTLINE_OPTION(slow_drift.standard_errors);
  FAULTLINE_OPTION(slow_drift.agreement_fraction);
  FAULTLINE_OPTION(slow_drift.evidence_fraction);
  FAULTLINE_OPTION(agreement.gain_fraction);
  FAULTLINE_OPTION(agreement.least_excess_variances);
  FAULTLINE_OPTION(agreement.rounds);
  FAULTLINE_OPTION(agreement.settled_gain_fraction);
  FAULTLINE_OPTION(agreement.apart_standard_errors);
  FAULTLINE_OPTION(agreement.apart_tolerances);
  FAULTLINE_OPTION(onset.least_segments);
  FAULTLINE_OPTION(onset.inside_segments);
  FAULTLINE_OPTION(onset.least_step_variances);
  FAULTLINE_OPTION(onset.rounds);
  FAULTLINE_OPTION(onset.settled_tolerances);
  FAULTLINE_OPTION(onset.before_fraction);
  FAULTLINE_OPTION(onset.shown_fraction);
  FAULTLINE_OPTION(onset.least_excess_variances);
  FAULTLINE_OPTION(onset.explained_fraction);
  FAULTLINE_OPTION(onset.tolerance_fraction);
  FAULTLINE_OPTION(onset.untold_tolerances);
  FAULTLINE_OPTION(onset.contradicted_fraction);
  FAULTLINE_OPTION(verdict.quiet_excess_variances);
  FAULTLINE_OPTION(verdict.quiet_noisy_fraction);
  FAULTLINE_OPTION(verdict.material_evidence_fraction);
  FAULTLINE_OPTION(verdict.material_shrink_fraction);
  FAULTLINE_OPTION(verdict.small_gap_shrink_fraction);
  FAULTLINE_OPTION(verdict.named_shrink_fraction);
  FAULTLINE_OPTION(verdict.named_output_shrink_fraction);
  FAULTLINE_OPTION(verdict.shifted_fraction);
  FAULTLINE_OPTION(verdict.hidden_shrink_fraction);
  FAULTLINE_OPTION(verdict.closed_shrink_fraction);
  FAULTLINE_OPTION(verdict.nearly_closed_fraction);
  FAULTLINE_OPTION(verdict.little_left_variances);
  FAULTLINE_OPTION(verdict.little_left_shrink_fraction);
  FAULTLINE_OPTION(verdict.beside_log_likelihood);
  FAULTLINE_OPTION(verdict.named_matters_fraction);
  FAULTLINE_OPTION(verdict.free_evidence_fraction);
  FAULTLINE_OPTION(verdict.size_spread);
  FAULTLINE_OPTION(verdict.partial_evidence_fraction);
  FAULTLINE_OPTION(verdict.place_evidence_fraction);
  FAULTLINE_OPTION(verdict.place_log_likelihood);
  FAULTLINE_OPTION(verdict.material_excess_variances);
  FAULTLINE_OPTION(verdict.silent_matters_ratio);
  FAULTLINE_OPTION(verdict.silent_excess_variances);
  FAULTLINE_OPTION(verdict.miscalibrated_excess_variances);
  FAULTLINE_OPTION(verdict.doubt_steepness);
  FAULTLINE_OPTION(verdict.rival_standard_errors);
  FAULTLINE_OPTION(verdict.rival_gain_fraction);
  FAULTLINE_OPTION(verdict.interval_ratio);
  FAULTLINE_OPTION(verdict.few_segments);
  FAULTLINE_OPTION(verdict.place_probability);
  FAULTLINE_OPTION(verdict.bound_coordinate);
  FAULTLINE_OPTION(verdict.bootstraps);
  FAULTLINE_OPTION(regions.standstill_fraction);
  FAULTLINE_OPTION(regions.notable_ratio);
  FAULTLINE_OPTION(regions.least_fraction);
  FAULTLINE_OPTION(regions.most);
  FAULTLINE_OPTION(regions.quantile_stride);
  FAULTLINE_OPTION(grid.least_levels);
  FAULTLINE_OPTION(grid.least_noise_fraction);
  FAULTLINE_OPTION(grid.half_width_fraction);
  FAULTLINE_OPTION(next_runs.segments);
  FAULTLINE_OPTION(next_runs.least_segments);
  FAULTLINE_OPTION(next_runs.separating_log_likelihood);
  FAULTLINE_OPTION(next_runs.most);
#undef FAULTLINE_OPTION
}

}  // namespace faultline
