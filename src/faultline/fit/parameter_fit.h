// Estimates the parameters that a rig's datasheet marks `identify: true` from recordings, with 90 % intervals.
//
//   minimise  sum over segments of rho(|r_w(p)|^2 / (values per segment))      r_w: segments/linearisation.h, rho: Huber's
//
// by Ceres's trust region; the scatter of each channel is estimated along (it is the model's error, not the noise,
// that limits a rig's model). An interval holds three parts, added as variances:
//   statistical  H^-1 (sum of g g') H^-1 over blocks of segments (Huber, White): right for residuals that are neither
//                white nor normal
//   parameters   how far the estimate moves when a parameter that is not estimated is off by its tolerance
//   effects      how far it moves when an effect of the datasheet's `nuisance` is there
// A parameter whose interval is no narrower than its tolerance is not determined by these runs: it keeps the
// datasheet's value, the others are fitted again without it, and the reason is said. Assumes that the first segments'
// start states are well measured and that parameters stay the same over all runs; an effect that the datasheet does
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
  double estimate = 0, low = 0, high = 0;  // 90 %; where not determined: nominal and its tolerance
  double statistical = 0, systematic = 0;  // standard errors, relative to the estimate
  bool determined = true;
  std::string reason;  // why not
};

struct ChannelMisfit {  // in the channel's unit
  std::string channel, unit;
  double noise = 0, before = 0, after = 0;  // root mean square of residuals: start states put back every segment
};

struct ParameterFit {
  std::vector<FittedParameter> parameters;  // the marked ones, in the datasheet's order
  std::vector<double> values;               // of all parameters, in the datasheet's order
  std::vector<ChannelMisfit> channels;
  std::size_t segments = 0;
  double segment_duration = 0;  // s
};

using FitProgress = std::function<void(const std::string&)>;

// InputError where the datasheet marks nothing or a run cannot be used. Uses `jobs` threads; the answer does not
// depend on how many.
ParameterFit fit_parameters(const Datasheet& sheet, std::vector<std::pair<std::string, Recording>> runs, int jobs,
                            const FitProgress& progress = {}, const FitOptions& options = {});

}  // namespace faultline
