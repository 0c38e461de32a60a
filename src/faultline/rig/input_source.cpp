#include "faultline/rig/input_source.h"

#include <algorithm>
#include <cmath>

#include "faultline/numerics/random.h"

namespace faultline {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr int kWanderTones = 12;                 // sines that make up the wander
constexpr std::uint64_t kSecondSeed = 15485863;  // of what moves the level, beside its wander

}  // namespace

InputSource::InputSource(const InputSignal& signal, const InputLevel& level, std::uint64_t seed, double period)
    : value_(level.value),
      droop_(signal.droop),
      lag_share_(signal.lag > 0 ? 1 - std::exp(-period / signal.lag) : 1.0),
      droop_share_(signal.droop_lag > 0 ? 1 - std::exp(-period / signal.droop_lag) : 1.0),
      lags_(static_cast<std::size_t>(signal.lags)) {
  if (!level.shape.empty()) moves_ = make_excitation(level.shape, level.settings, seed + kSecondSeed);
  Random random(seed);
  if (signal.wander_std <= 0) return;
  for (int k = 0; k < kWanderTones; ++k) {
    const double share = (k + random.uniform()) / kWanderTones;
    tones_.push_back(
        {signal.wander_low * std::pow(signal.wander_high / signal.wander_low, share), random.uniform(0, 2 * kPi)});
  }
  amplitude_ = signal.wander_std * std::sqrt(2.0 / kWanderTones);
}

double InputSource::value(double time, double drawn) {
  double level = moves_ ? moves_->value(time) : 0.0;
  if (time <= 0) std::fill(lags_.begin(), lags_.end(), level);
  for (double& lag : lags_) level = lag += lag_share_ * (level - lag);
  if (time > 0) drawn_ += droop_share_ * (drawn - drawn_);
  double sum = 0;
  for (const auto& [frequency, phase] : tones_) sum += std::sin(2 * kPi * frequency * time + phase);
  return value_ + level + amplitude_ * sum - droop_ * drawn_;
}

}  // namespace faultline
