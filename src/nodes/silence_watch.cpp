#include "nodes/silence_watch.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace faultline {
namespace {

constexpr double kStands = 1;  // s

}  // namespace

void SilenceWatch::arrived(double sample_time, double steady, double simulated) {
  any_ = true;
  sample_time_ = sample_time;
  steady_ = steady;
  simulated_ = simulated;
  waited_ = false;
}

double SilenceWatch::now(double steady, double simulated) {
  const double silent = steady - steady_ - patience_;
  if (!any_ || silent <= 0) return std::numeric_limits<double>::quiet_NaN();
  if (std::isnan(simulated)) return sample_time_ + silent;
  if (!waited_) simulated_ = std::max(simulated_, simulated);
  waited_ = true;
  if (!(simulated > simulated_)) return std::numeric_limits<double>::quiet_NaN();
  return sample_time_ + (simulated - simulated_);
}

bool SilenceWatch::clock_stands(double steady, double simulated) {
  if (std::isnan(simulated)) return false;
  if (simulated != clock_value_) {
    clock_value_ = simulated;
    clock_moved_ = steady;
  }
  return steady - clock_moved_ > kStands;
}

}  // namespace faultline
