#include "faultline/isolation/bad_channels.h"

#include <algorithm>
#include <limits>

namespace faultline {
namespace {

// The time in which a person reads one line, well above the pause between two bursts of a loose contact; but never less
// than three samples: a slow rig shows no burst in a second.
constexpr double kHold = 1;  // s
constexpr double kHoldPeriods = 3;
// Healthy rigs of all kinds stay there for 0.13 s at most: a rod against its stop, a valve that is shut.
constexpr double kAtEnd = 2;  // s
constexpr double kAtEndPeriods = 64;

}  // namespace

BadChannels::BadChannels(const Datasheet& sheet)
    : hold_(std::max(kHold, kHoldPeriods * sheet.sample_period)),
      at_end_(std::max(kAtEnd, kAtEndPeriods * sheet.sample_period)) {
  for (const Channel& channel : sheet.channels) {
    Watched w;
    w.watched = channel.role != Role::setpoint && !channel.ground_truth;
    w.noisy = w.watched && channel.role != Role::command && channel.noise_std > 0;
    channels_.push_back(w);
  }
}

void BadChannels::reset() {
  for (Watched& w : channels_) {
    w.bad = false;
    w.trouble = ChannelStatus::good;
    w.last_within = std::numeric_limits<double>::infinity();
  }
  held_ = any_bad_ = unusable_ = false;
}

bool BadChannels::all_held(const std::vector<ChannelStatus>& status) const {
  int frozen = 0;
  for (std::size_t c = 0; c < channels_.size() && c < status.size(); ++c) {
    if (!channels_[c].noisy) continue;
    if (status[c] == ChannelStatus::frozen)
      ++frozen;
    else if (status[c] != ChannelStatus::at_end)
      return false;
  }
  return frozen > 1;
}

void BadChannels::process(double time, const std::vector<ChannelStatus>& status) {
  if (all_held(status)) {
    if (!held_) held_since_ = time;
    held_ = true;
    last_held_ = time;
  } else if (held_ && time - last_held_ > hold_) {
    held_ = false;
  }
  any_bad_ = unusable_ = held_;
  bad_since_ = held_ ? held_since_ : time;
  for (std::size_t c = 0; c < channels_.size() && c < status.size(); ++c) {
    Watched& w = channels_[c];
    if (!w.watched) continue;
    if (status[c] != ChannelStatus::at_end) w.last_within = time;
    const bool at_end = status[c] == ChannelStatus::at_end && !held_ && time - w.last_within >= at_end_;
    if (at_end || (status[c] != ChannelStatus::good && status[c] != ChannelStatus::at_end)) {
      if (status[c] != ChannelStatus::frozen || !held_) {
        if (!w.bad) w.since = at_end ? w.last_within : time;
        const bool stays = w.bad && w.trouble != ChannelStatus::out_of_range && time - w.last_trouble <= hold_;
        if (!stays) w.trouble = status[c];
        if (w.trouble == status[c]) w.last_trouble = time;
        w.bad = true;
      }
      w.last_bad = time;
    } else if (w.bad && time - w.last_bad > hold_) {
      w.bad = false;
      w.trouble = ChannelStatus::good;
    }
    if (!w.bad) continue;
    any_bad_ = true;
    unusable_ = unusable_ || w.trouble == ChannelStatus::quiet || w.trouble == ChannelStatus::at_end;
    bad_since_ = std::min(bad_since_, w.since);
  }
}

}  // namespace faultline
