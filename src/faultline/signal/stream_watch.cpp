#include "faultline/signal/stream_watch.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace faultline {
namespace {

constexpr double kWindow = 10;  // s
constexpr double kLeast = 10, kMost = 100;
constexpr double kRate = 0.01, kOff = 0.25, kJitter = 0.1;

}  // namespace

StreamWatch::StreamWatch(double period)
    : period_(period), window_(static_cast<std::size_t>(std::clamp(kWindow / period, kLeast, kMost))) {
  steps_.reserve(window_);
}

void StreamWatch::add(std::uint64_t sequence, double stamp) {
  ++samples_;
  if (stamp == 0) ++zero_;
  if (any_) {
    if (stamp == last_stamp_) ++still_;
    if (sequence == last_sequence_) ++not_counting_;
    const double counted = sequence > last_sequence_ ? static_cast<double>(sequence - last_sequence_) : 1;
    if (stamp > last_stamp_) steps_.push_back((stamp - last_stamp_) / counted);
  }
  any_ = true;
  last_stamp_ = stamp;
  last_sequence_ = sequence;
  if (samples_ < window_) return;
  trouble_ = judge();
  samples_ = zero_ = still_ = not_counting_ = 0;
  steps_.clear();
}

std::string StreamWatch::judge() {
  const auto most = [this](std::size_t count) { return 2 * count > samples_; };
  if (most(zero_)) return "the samples' stamps are 0; the source must stamp them with the time of measurement";
  if (most(still_)) return "the samples' stamps stand still; the source must stamp each with its time of measurement";
  if (most(not_counting_))
    return fmt::format(
        "the samples' numbers do not count (all are {}), so no loss can be seen; the source must number "
        "its samples",
        last_sequence_);
  if (steps_.empty()) return "";
  std::vector<double> sorted = steps_;
  std::sort(sorted.begin(), sorted.end());
  const double median = sorted[sorted.size() / 2];
  const auto off = std::count_if(sorted.begin(), sorted.end(),
                                 [&](double step) { return std::abs(step - median) > kOff * period_; });
  const double share = static_cast<double>(off) / static_cast<double>(sorted.size());
  if (std::abs(median - period_) > kOff * period_ || (share <= kJitter && std::abs(median - period_) > kRate * period_))
    return fmt::format("samples come every {:.4g} s, the rig's datasheet says {:.4g} s", median, period_);
  if (share > kJitter)
    return fmt::format("the samples' stamps jitter: {:.0f} % of their steps are more than a quarter of {:.4g} s off",
                       100 * share, period_);
  return "";
}

}  // namespace faultline
