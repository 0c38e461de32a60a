// Every constant of the signature isolator on which an answer depends: what it means, its unit (in the name), why it
// has this value. docs/options.md has how much the answers change when each is halved and doubled.
//
// chi-squared: squared Mahalanobis distance of residuals from what a hypothesis says of them. Units else as in
// gap/gap_options.h.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "faultline/rig/datasheet.h"

namespace faultline {

struct SignatureOptions {
  // ---- the datasheet's: a key of the isolator, where it says why
  double learn_s = 0;                       // learn: of steady operation, whose mean is the reference
  double window_s = 0;                      // window: the latest, over which an event is judged
  double patience_s = 0;                    // patience: how long several rivals may go on before they are told together
  double release_time_s = 0;                // release_time: of silence, after which a finding ends
  double false_alarms_per_hour = 0;         // over all residuals, from which the CUSUMs' thresholds follow
  double noise_limit = 0;                   // of a residual's sigma, beyond which it is left out; a residual's unit
  double rival_chi_squared = 0;             // rival: within which hypotheses cannot be told apart
  double significance_chi_squared = 0;      // significance: by which a fault must fit better than no change
  double fit_chi_squared_per_residual = 0;  // fit: above which no single fault explains an event
  double relative_error_fraction = 0;       // relative_error: of a size, from the tolerances of the balances
  std::size_t confirm_samples = 0;          // confirm: of an event, before it is judged
  std::vector<double> change;               // change_KIND, per residual: smallest change that matters, its unit
  std::vector<double> floor;  // floor_KIND, per residual: what the balances get wrong by themselves, its unit

  // ---- the method's
  std::size_t every_samples = 20;  // from one evaluation of an event to the next: bounds the effort
  std::size_t settled_ratio =
      3;  // of that to the same once the event is older than the window, an eighth of which it then is
  std::size_t few_rivals = 3;      // hypotheses beside the best, with which an event waits for `patience_s`
  std::size_t most_rivals = 6;     // beyond which naming the best would say nothing
  std::size_t size_steps = 3;      // Gauss-Newton steps of a size: signatures are nearly linear
  double balance_error_sigma = 2;  // of the balances' own error at a new operating point, that is no change: 95 %
  double course_age_fraction =
      0.9;                 // of the window: when the course of an event is judged, its beginning still in sight
  double early_s = 0.02;   // of an event, held against its plateau: short against the rise of a warmed wall
  double plateau_s = 0.1;  // at the end and in the middle, that must agree ...
  double plateau_change_fraction = 0.15;  // ... within this fraction of the last
  double early_noise_fraction =
      0.1;  // of the plateau, that the noise of the early mean may have for a course to be judged
  double course_miss_fraction = 0.35;        // of the plateau, that the early part may be off: a third, between 0 and 1
  double course_cost_chi_squared = 100;      // that a wrong course adds: more than any `rival`
  double drift_age_s = 2;                    // of an event, before its size over time says anything
  std::size_t drift_least_evaluations = 10;  // ... and in so many evaluations
  double straight_correlation = 0.9;         // of size and time, from which it is a ramp
  double drift_size_fraction = 0.5;  // of the size, that the ramp must make up: a filling window also rises at first
  double stuck_scatter_sigma = 4;    // by which sizes must scatter to show that the rig moves under a stuck sensor ...
  double stuck_reading_fraction = 0.15;  // ... of which the sensor's own reading may scatter
};

// `kinds`: by which change_KIND and floor_KIND are given, one per residual. `period`: s, of samples.
SignatureOptions read_signature_options(const Settings& settings, const std::vector<std::string>& kinds, double period);

// Values are doubles, counts, or vectors of doubles.
template <class Visit>
void for_each_option(SignatureOptions& options, Visit&& visit) {
#define FAULTLINE_OPTION(member) visit(#member, options.member)
  FAULTLINE_OPTION(learn_s);
  FAULTLINE_OPTION(window_s);
  FAULTLINE_OPTION(patience_s);
  FAULTLINE_OPTION(release_time_s);
  FAULTLINE_OPTION(false_alarms_per_hour);
  FAULTLINE_OPTION(noise_limit);
  FAULTLINE_OPTION(rival_chi_squared);
  FAULTLINE_OPTION(significance_chi_squared);
  FAULTLINE_OPTION(fit_chi_squared_per_residual);
  FAULTLINE_OPTION(relative_error_fraction);
  FAULTLINE_OPTION(confirm_samples);
  FAULTLINE_OPTION(change);
  FAULTLINE_OPTION(floor);
  FAULTLINE_OPTION(every_samples);
  FAULTLINE_OPTION(settled_ratio);
  FAULTLINE_OPTION(few_rivals);
  FAULTLINE_OPTION(most_rivals);
  FAULTLINE_OPTION(size_steps);
  FAULTLINE_OPTION(balance_error_sigma);
  FAULTLINE_OPTION(course_age_fraction);
  FAULTLINE_OPTION(early_s);
  FAULTLINE_OPTION(plateau_s);
  FAULTLINE_OPTION(plateau_change_fraction);
  FAULTLINE_OPTION(early_noise_fraction);
  FAULTLINE_OPTION(course_miss_fraction);
  FAULTLINE_OPTION(course_cost_chi_squared);
  FAULTLINE_OPTION(drift_age_s);
  FAULTLINE_OPTION(drift_least_evaluations);
  FAULTLINE_OPTION(straight_correlation);
  FAULTLINE_OPTION(drift_size_fraction);
  FAULTLINE_OPTION(stuck_scatter_sigma);
  FAULTLINE_OPTION(stuck_reading_fraction);
#undef FAULTLINE_OPTION
}

}  // namespace faultline
