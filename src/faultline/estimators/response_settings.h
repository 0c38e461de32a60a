// Every constant of the fault responses (stretch_model.h, fault_responses.h) on which an answer depends: what it
// means, its unit (in the name), why it has this value. docs/options.md has how much the answers change when each is
// halved and doubled.
//
// Evidence is twice a log-likelihood ratio, of squares divided by `inflation_variances`. Units else as in
// gap/gap_options.h; "found on one rig": chosen on its simulated healthy and faulty runs, no derivation.
#pragma once

#include <array>
#include <cstddef>
#include <string>

#include "faultline/attribution/fault_hypothesis.h"
#include "faultline/segments/segment_options.h"

namespace faultline {

// Start states are known as well as the smoothing says: in a short segment a wider prior takes most of what an effect
// shows.
inline SegmentOptions of_short_segments() {
  SegmentOptions options;
  options.start_prior_sigma = 0.4;
  options.long_steps = options.beside = options.rough = true;
  return options;
}

struct ResponseSettings {
  // ---- stretches
  double segment_s =
      0.1;  // from one restart of the states to the next: longer shows more, until stick and slip part ways
  std::size_t segments = 4;  // counted per stretch; one more runs before them, so that effects with memory settle
  double every_s = 2;        // between the beginnings of stretches: bounds the effort
  double early_every_s = 2;  // the same of the first early_stretches: a slow rig is to be known before an hour has gone
  std::size_t recent_stretches = 3;              // in which a fault is looked for
  double memory_stretches = 10;                  // how long earlier ones speak for the parameters
  double inflation_variances = 30;               // residuals of a model that is a little wrong are not independent
  double parameter_difference_tolerances = 0.5;  // step of the differences by a parameter
  double least_response = 1e-6;  // information about an amplitude below which nothing is said: standstill

  // ---- which stretches are looked at closely
  std::size_t refresh_stretches = 16;  // one in so many is, whatever it holds: what is learnt must not age
  std::size_t smooth_terms = 10;       // cosines per segment and output that hold what an effect does: up to 45 Hz
                                       // in segments of 0.1 s, where a plant that stands in it no longer follows
  double new_fraction = 0.1;           // of the threshold: misfit of a stretch by which it says something new
  double weighed_fraction = 0.6;       // ... and below which, beyond white noise, causes are not weighed: none is told
  double followed_fraction = 0.02;     // of the evidence of a fault that is known: misfit from which it is followed
  // The same beyond what stretches leave usually, that no cause explains, from which in so many stretches in a row the
  // model has lost the rig. No healthy run reaches it in 2 h each of four rigs, three ripples of a supply do.
  double lost_fraction = 0.75;
  std::size_t lost_stretches = 4;
  double least_nuisance_amplitude = 0.05;  // of a nuisance effect, from which it is in the model of what is known

  // ---- parameters
  double relinearise_tolerances = 0.3;  // move of a parameter from which the model is made linear anew
  double reused_tolerances = 1;         // move up to which its derivatives are kept: a response bends little in that
  double farthest_tolerances = 3;       // that a parameter may be off the datasheet: three standard deviations
  std::size_t parameter_moves = 5;      // at once, at most
  std::array<double, 4> reach_tolerances = {0.75, -0.75, 1.5, -1.5};  // tried where the linear model is doubted
  double worthwhile_evidence = 3;                                     // that such a move must win
  // of that, changed by one of the first two reaches, from which a response bends enough to try others
  double bent_fraction = 0.25;
  double suspicion_fraction =
      0.3;                         // of the threshold, from which the linear model is doubted before anything is blamed
  std::size_t past_stretches = 4;  // healthy ones kept, that must agree before parameters are moved instead
  std::size_t early_stretches = 4;  // after which what is done again is done ever more rarely

  // ---- the fault
  double threshold_evidence = 30;  // from which there is a fault: a bound on false alarms, found on one rig
  double release_fraction = 0.3;   // of the threshold, below which a fault is over: hysteresis against flicker
  // A fault is told when stretches after those that found it have won as much again, or when it has so many times that:
  // what a chance, or a passing error of the model, has found says nothing of what comes next.
  double confirmed_fraction = 1;
  double sure_ratio = 5;
  // Of the threshold, left in the residuals of the recent stretches beyond white noise, up to which the rig without
  // faults explains them: several small errors of the model in different directions are no fault.
  double explained_ratio = 3;
  // Mean square residual in variances of the noise from which nothing is explained, however little of it an effect
  // could win: segments count the less the farther off the model is. Healthy rigs, off nominal, reach 4.
  double far_off_variances = 100;
  double over_evidence = 5;       // by which the latest stretch speaks against a fault that was there
  double longer_fraction = 0.05;  // of the evidence, by which one more stretch must speak for a fault to be part of it
  // Of the largest amplitude, tried beside the linear answer: sizes whose answers differ, over ranges of many decades.
  std::array<double, 3> coarse_fractions = {0.15, 0.4, 1};
  double pace_fraction = 0.25;  // of what the first wins up to any segment, that a size must win up to there to go on
  std::size_t refined_hypotheses = 6;     // by Gauss-Newton steps on the model with the effect in it
  std::size_t refinements = 3;            // steps, at most
  double refine_step_fraction = 0.1;      // of an amplitude: step of its differences ...
  double refine_step_sigma = 0.2;         // ... and at least this, in standard errors of the amplitude
  double refine_reach_sigma = 3;          // move of one step, where that is more than the amplitude itself
  double refine_settled_fraction = 0.01;  // of the evidence, gained by a step, below which it is the last
  double grown_ratio = 1.5;   // of the evidence to that at the last refinement, from which all are refined anew,
  double moved_ratio = 1.25;  // ... and of the size: by more than its bounds usually are wide
  std::size_t looked_hypotheses = 6;      // by evidence, looked at closely while a fault lasts ...
  std::size_t kept_hypotheses = 12;       // ... beside those that explained it best when it was found
  double second_misfit_fraction = 0.5;    // of what a second must have, that the first must leave: a margin of two
  double near_fraction = 0.75;            // of that, with derivatives from the model without the first: a margin
  double second_evidence_fraction = 0.3;  // of the first fault's, that a second must have beyond the threshold
  double alternative_evidence_fraction =
      0.5;  // of the first fault's, from which a hypothesis is an alternative, not a second

  HypothesisOptions hypotheses;
  SegmentOptions segment = of_short_segments();
  int jobs = 1;  // threads; no answer depends on it

  double stretch_s() const { return static_cast<double>(segments + 1) * segment_s; }
};

// Evidence that causes must be able to win together before they are weighed.
inline double weighed_from(const ResponseSettings& settings) {
  return settings.weighed_fraction * settings.threshold_evidence;
}

template <class Visit>
void for_each_option(ResponseSettings& options, Visit&& visit) {
  for_each_option(options.segment,
                  [&](const char* name, auto& value) { visit((std::string("segment.") + name).c_str(), value); });
#define FAULTLINE_OPTION(member) visit(#member, options.member)
  FAULTLINE_OPTION(segment_s);
  FAULTLINE_OPTION(segments);
  FAULTLINE_OPTION(every_s);
  FAULTLINE_OPTION(early_every_s);
  FAULTLINE_OPTION(recent_stretches);
  FAULTLINE_OPTION(memory_stretches);
  FAULTLINE_OPTION(inflation_variances);
  FAULTLINE_OPTION(parameter_difference_tolerances);
  FAULTLINE_OPTION(least_response);
  FAULTLINE_OPTION(refresh_stretches);
  FAULTLINE_OPTION(smooth_terms);
  FAULTLINE_OPTION(new_fraction);
  FAULTLINE_OPTION(weighed_fraction);
  FAULTLINE_OPTION(followed_fraction);
  FAULTLINE_OPTION(lost_fraction);
  FAULTLINE_OPTION(lost_stretches);
  FAULTLINE_OPTION(least_nuisance_amplitude);
  FAULTLINE_OPTION(relinearise_tolerances);
  FAULTLINE_OPTION(reused_tolerances);
  FAULTLINE_OPTION(farthest_tolerances);
  FAULTLINE_OPTION(parameter_moves);
  FAULTLINE_OPTION(reach_tolerances);
  FAULTLINE_OPTION(worthwhile_evidence);
  FAULTLINE_OPTION(bent_fraction);
  FAULTLINE_OPTION(suspicion_fraction);
  FAULTLINE_OPTION(past_stretches);
  FAULTLINE_OPTION(early_stretches);
  FAULTLINE_OPTION(threshold_evidence);
  FAULTLINE_OPTION(release_fraction);
  FAULTLINE_OPTION(confirmed_fraction);
  FAULTLINE_OPTION(sure_ratio);
  FAULTLINE_OPTION(explained_ratio);
  FAULTLINE_OPTION(far_off_variances);
  FAULTLINE_OPTION(over_evidence);
  FAULTLINE_OPTION(longer_fraction);
  FAULTLINE_OPTION(coarse_fractions);
  FAULTLINE_OPTION(pace_fraction);
  FAULTLINE_OPTION(refined_hypotheses);
  FAULTLINE_OPTION(refinements);
  FAULTLINE_OPTION(refine_step_fraction);
  FAULTLINE_OPTION(refine_step_sigma);
  FAULTLINE_OPTION(refine_reach_sigma);
  FAULTLINE_OPTION(refine_settled_fraction);
  FAULTLINE_OPTION(grown_ratio);
  FAULTLINE_OPTION(moved_ratio);
  FAULTLINE_OPTION(looked_hypotheses);
  FAULTLINE_OPTION(kept_hypotheses);
  FAULTLINE_OPTION(second_misfit_fraction);
  FAULTLINE_OPTION(near_fraction);
  FAULTLINE_OPTION(second_evidence_fraction);
  FAULTLINE_OPTION(alternative_evidence_fraction);
  FAULTLINE_OPTION(hypotheses.logarithmic_ratio);
  FAULTLINE_OPTION(hypotheses.small_amplitude);
  FAULTLINE_OPTION(hypotheses.least_amplitude_ratio);
  FAULTLINE_OPTION(hypotheses.open_ratio);
#undef FAULTLINE_OPTION
}

// Those that a datasheet may set, by its keys: segment [s], segments, every [s], recent, memory, inflation, threshold,
// confirmed (of the threshold). Without `segment` two fifths of the rig's (segments/segment_length.h), without `every`
// four stretches.
ResponseSettings read_response_settings(const Settings& settings, const Datasheet& sheet);

}  // namespace faultline
