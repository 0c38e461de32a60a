#include "faultline/estimators/channel_watch.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace faultline {
namespace {

constexpr double kNoisy = 6, kQuiet = 50;  // times the noise of the datasheet
constexpr double kWhite = 0.6;             // medians of 64 differences scatter by a seventh
constexpr double kMotion = 20;             // as for the gap (segment_options.h)
constexpr int kBlocksOnEnd = 2;
constexpr double kSpike = 12;  // sigma
constexpr int kSpikes = 3;
constexpr double kRounded = 2;        // resolutions over noise, from which equal readings are nothing unusual
constexpr double kByChance = 1e-13;   // of as many equal readings
constexpr double kLeastShare = 1e-6;  // of equal neighbours, where nothing is rounded
constexpr double kFewestEqual = 5;
constexpr double kHeldShare = 0.75, kMostEqualShare = 0.3;  // of equal neighbours: of held readings, by chance
constexpr double kSixthWeight = 30.397368307141328;         // sqrt(924)
constexpr double kRootOfSix = 2.449489742783178;
constexpr double kMedianOfNormal = 0.6744897501960817;
constexpr double kRootOfPi = 1.7724538509055159;

double median_of(std::array<double, 64>& values) {
  const auto middle = values.begin() + values.size() / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double sixth_difference(const double* x) { return x[0] + x[6] - 6 * (x[1] + x[5]) + 15 * (x[2] + x[4]) - 20 * x[3]; }

}  // namespace

ChannelWatch::ChannelWatch(const Channel& channel)
    : low_(channel.minimum),
      high_(channel.maximum),
      command_(channel.role == Role::command),
      input_(channel.role == Role::input),
      watched_(channel.role != Role::setpoint && !channel.ground_truth && channel.noise_std > 0) {
  if (!watched_) return;
  sigma_ = std::hypot(channel.noise_std, channel.resolution / std::sqrt(12.0));
  rounded_ = channel.resolution > kRounded * channel.noise_std;
  equal_share_ = std::max(channel.resolution / (2 * kRootOfPi * channel.noise_std), kLeastShare);
  const double count = 1 + std::ceil(std::log(kByChance) / std::log(equal_share_));
  count_ = rounded_ ? 0 : static_cast<std::size_t>(std::max(kFewestEqual, count));
}

void ChannelWatch::reset() {
  spikes_ = {};
  count_read_ = same_ = longest_ = equal_ = ends_ = block_ = 0;
  noisy_ = quiet_ = 0;
  status_ = ChannelStatus::good;
}

ChannelStatus ChannelWatch::add(double value) {
  if (!watched_) return ChannelStatus::good;
  const bool end = value <= low_ || value >= high_;
  same_ = count_read_ > 0 && value == readings_[count_read_ - 1] && !end ? same_ + 1 : 1;
  longest_ = std::max(longest_, same_);
  equal_ += same_ > 1;
  ends_ += end;
  readings_[count_read_++] = value;
  if (count_read_ == readings_.size()) status_ = judge();
  return status_;
}

bool ChannelWatch::is_noise() const {
  static_assert(kBlock == 64);
  std::array<double, kBlock> fast, slow;
  for (std::size_t i = 0; i < kBlock; ++i) {
    const double* x = &readings_[i];
    fast[i] = std::abs(sixth_difference(x));
    slow[i] = std::abs(x[1] - 2 * x[3] + x[5]);
  }
  const double noise = median_of(fast) / kSixthWeight;
  return noise >= kWhite * median_of(slow) / kRootOfSix && !(input_ && noise > kMotion * kMedianOfNormal * sigma_);
}

ChannelStatus ChannelWatch::judge() {
  // The median, the upper of the two in the middle, is beyond a limit where fewer than half and one are up to it: two
  // counts say as much of it as is asked for, in a fraction of what finding it takes.
  const double unit = kSixthWeight * kMedianOfNormal * sigma_;
  const double noisy_from = kNoisy * unit, quiet_to = unit / kQuiet;
  int spikes = 0, calm = 0, silent = 0;
  for (std::size_t i = 0; i < kBlock; ++i) {
    const double* x = &readings_[i];
    const double sixth = std::abs(sixth_difference(x));
    calm += sixth <= noisy_from;
    silent += sixth < quiet_to;
    const double least = std::min(std::min(x[1], x[2]), std::min(x[4], x[5]));
    const double most = std::max(std::max(x[1], x[2]), std::max(x[4], x[5]));
    const double beyond = std::max(x[3] - most, least - x[3]);
    spikes += beyond > kSpike * sigma_ + 3 * (most - least);
  }
  constexpr int kHalf = static_cast<int>(kBlock) / 2;
  spikes_[block_] = calm > kHalf ? spikes : 0;
  const bool all_at_end = ends_ >= kBlock;
  const bool tells = ends_ == 0 && !rounded_;
  const bool held = equal_share_ < kMostEqualShare && static_cast<double>(equal_) >= kHeldShare * kBlock;
  const bool frozen = (count_ > 0 && longest_ >= count_) || held;
  noisy_ = tells && calm <= kHalf && is_noise() ? noisy_ + 1 : 0;
  quiet_ = tells && !frozen && silent > kHalf ? quiet_ + 1 : 0;
  const bool spiky = std::accumulate(spikes_.begin(), spikes_.end(), 0) >= kSpikes;
  block_ = (block_ + 1) % kBlocks;
  std::copy(readings_.end() - kAround, readings_.end(), readings_.begin());
  count_read_ = kAround;
  longest_ = same_;
  equal_ = ends_ = 0;
  if (frozen) return ChannelStatus::frozen;
  if (command_) return ChannelStatus::good;
  if (noisy_ >= kBlocksOnEnd) return ChannelStatus::noisy;
  if (spiky) return ChannelStatus::spiky;
  if (quiet_ >= kBlocksOnEnd) return ChannelStatus::quiet;
  return all_at_end ? ChannelStatus::at_end : ChannelStatus::good;
}

}  // namespace faultline
