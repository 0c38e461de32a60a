// Every constant of the parameter fit on which an answer depends: what it means, its unit (in the name), why it has
// this value. docs/options.md has how much the answers change when each is halved and doubled. Units as in
// gap/gap_options.h.
#pragma once

#include <cstddef>
#include <string>

#include "faultline/segments/segment_options.h"

namespace faultline {

// parameter_fit.h, fit_errors.h, segment_solver.h.
struct FitOptions {
  std::size_t first_iterations = 10;     // of the trust region in the first round and from another start, at most
  std::size_t next_iterations = 3;       // ... and where only the scatter changed
  std::size_t rounds = 20;               // scatter and parameters in turn, at most; else the fit has not converged
  double settled_tolerances = 0.02;      // move of every parameter in a round below which it has
  std::size_t other_starts = 6;          // beside the datasheet's values
  double other_start_tolerances = 1.5;   // standard deviation of those: well outside what one rig differs from another
  double better_cost_fraction = 1e-3;    // by which another start must end lower: above what the stopping rule leaves
  double near_cost_fraction = 0.05;      // ... within which it is followed to its end
  double alike_log_likelihood = 5;       // by which an answer elsewhere may be worse and still not be excluded
  std::size_t valley_steps = 6;          // each way along the direction that is known least ...
  double valley_step_tolerances = 0.25;  // ... so far, where states are hidden,
  std::size_t valley_rounds = 3;         // the starts and the other parameters in turn at each
  double unmarked_tolerance_fraction = 0.1;  // of a parameter to be identified whose tolerance the datasheet gives as 0
  double seen_error_tolerances = 0.5;  // error with all others known, below which the run does respond to a parameter
  double named_exponent = 0.05;        // change in percent, per percent, from which the reason names another parameter
  double valley_ratio = 2;  // of the rise of the cost to the Hessian's, or its inverse, that doubts the latter
  double difference_tolerances = 0.1;  // step of the differences by a parameter
  double huber_sigma = 1.5;            // root mean square of a segment in scatters beyond which it counts less
  double lowest_ratio = 0.1;           // to the datasheet's value: bounds of a parameter ...
  double highest_ratio = 10;           // ... which no wrong model may carry further off
  std::size_t block_segments = 4;  // whose gradients are summed before their scatter is taken: what neighbours share
  double scatter_fraction = 0.9;   // of the segments, the best, that set the scatter: a few may go astray
  double wrong_model_ratio = 3;    // of what is left to the noise, from which the model is said to lack something
  double cost_tolerance_fraction = 1e-4;  // change of the cost at which the trust region stops: far below the scatter
  double step_tolerance_fraction = 1e-3;  // step of the parameters at which it stops
  SegmentOptions segments;
};

template <class Visit>
void for_each_option(FitOptions& options, Visit&& visit) {
  for_each_option(options.segments,
                  [&](const char* name, auto& value) { visit((std::string("segments.") + name).c_str(), value); });
#define FAULTLINE_OPTION(member) visit(#member, options.member)
  FAULTLINE_OPTION(first_iterations);
  FAULTLINE_OPTION(next_iterations);
  FAULTLINE_OPTION(rounds);
  FAULTLINE_OPTION(settled_tolerances);
  FAULTLINE_OPTION(other_starts);
  FAULTLINE_OPTION(other_start_tolerances);
  FAULTLINE_OPTION(better_cost_fraction);
  FAULTLINE_OPTION(near_cost_fraction);
  FAULTLINE_OPTION(alike_log_likelihood);
  FAULTLINE_OPTION(valley_steps);
  FAULTLINE_OPTION(valley_step_tolerances);
  FAULTLINE_OPTION(valley_rounds);
  FAULTLINE_OPTION(unmarked_tolerance_fraction);
  FAULTLINE_OPTION(seen_error_tolerances);
  FAULTLINE_OPTION(named_exponent);
  FAULTLINE_OPTION(valley_ratio);
  FAULTLINE_OPTION(difference_tolerances);
  FAULTLINE_OPTION(huber_sigma);
  FAULTLINE_OPTION(lowest_ratio);
  FAULTLINE_OPTION(highest_ratio);
  FAULTLINE_OPTION(block_segments);
  FAULTLINE_OPTION(scatter_fraction);
  FAULTLINE_OPTION(wrong_model_ratio);
  FAULTLINE_OPTION(cost_tolerance_fraction);
  FAULTLINE_OPTION(step_tolerance_fraction);
#undef FAULTLINE_OPTION
}

}  // namespace faultline
