#include "faultline/isolation/channel_watch.h"

#include <algorithm>

namespace faultline {
namespace {

// The time in which a person reads one line, well above the pause between two bursts of a loose contact; but never less
// than three samples: a slow rig shows no burst in a second.
constexpr double kHold = 1;  // s
constexpr double kHoldPeriods = 3;

}  // namespace

ChannelWatch::ChannelWatch(const Datasheet& sheet) : hold_(std::max(kHold, kHoldPeriods * sheet.sample_period)) {
  for (const Channel& channel : sheet.channels)
    channels_.push_back({channel.role != Role::setpoint && !channel.ground_truth, false, 0});
}

void ChannelWatch::reset() {
  for (Watched& w : channels_) w.bad = false;
}

void ChannelWatch::process(double time, const std::vector<ChannelStatus>& status) {
  for (std::size_t c = 0; c < channels_.size() && c < status.size(); ++c) {
    Watched& w = channels_[c];
    if (!w.watched) continue;
    if (status[c] != ChannelStatus::good) {
      w.bad = true;
      w.last_bad = time;
    } else if (w.bad && time - w.last_bad > hold_) {
      w.bad = false;
    }
  }
}

}  // namespace faultline
