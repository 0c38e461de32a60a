// Estimates the parameters that a rig's datasheet marks `identify: true` from recordings, with 90 % intervals.
//
//   minimise  sum over segments of rho(|r_w(p)|^2 / (values per segment)) + prior      r_w: segments/linearisation.h,
//                                                                                      rho: Huber's
//
// by Ceres's trust region, from the datasheet's values and from other starts; the scatter of each channel is estimated
// along (it is the model's error, not the noise, that limits a rig's model). The prior, segment_solver.h, holds what
// the runs do not see near the datasheet. Intervals and what counts as determined: fit_errors.h. A parameter that the
// data alone do not know to one tolerance is not determined, and the reason is said; its value is the one that fits
// nearest to the datasheet. Assumes that parameters stay the same over all runs; an effect that the datasheet does
// not know biases the estimates.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "faultline/fit/fit_options.h"
#include "faultline/segments/segment_model.h"

namespace faultline {

struct FittedParameter {
  std::string name, unit;
  double nominal = 0, tolerance = 0;
  double estimate = 0, low = 0, high = 0;  // 90 %, tolerance included
  double statistical = 0, systematic = 0;  // standard errors, relative to the estimate
  bool determined = true;
  bool at_bound = false;  // at the end of what a fit may change
  std::string reason;     // why not
};

struct ChannelMisfit {  // in the channel's unit
  std::string channel, unit;
  double noise = 0, before = 0, after = 0;  // root mean square of residuals: start states put back every segment ...
  double free = 0;                          // ... and of a free run with the estimates
};

struct ParameterFit {
  std::vector<FittedParameter> parameters;  // the marked ones, in the datasheet's order
  std::vector<double> values;               // of all parameters, in the datasheet's order
  std::vector<ChannelMisfit> channels;
  std::size_t segments = 0;
  double segment_duration = 0;  // s
  bool converged = true;
  bool stopped = false;              // before everything that secures the answer was done
  double freedom = 0;                // degrees, of the intervals
  std::vector<std::string> remarks;  // what to mind, each a sentence
};

using FitProgress = std::function<void(const std::string&)>;

// InputError where the datasheet marks nothing or a run cannot be used. Uses `jobs` threads; the answer does not
// depend on how many. Once `enough` says so, what only secures the answer is left out, with a remark: further rounds,
// other starts, the walk along the valley, the walls of intervals.
ParameterFit fit_parameters(const Datasheet& sheet, std::vector<std::pair<std::string, Recording>> runs, int jobs,
                            const FitProgress& progress = {}, const FitOptions& options = {},
                            const std::function<bool()>& enough = {});

}  // namespace faultline
