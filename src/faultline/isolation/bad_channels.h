// Which channels give bad numbers now, by the statuses that the first stage gives them (estimators/estimate.h). A
// channel counts as bad until for a while no bad number came, so that a loose contact is one trouble and not one a
// sample. Its trouble stays what it is as long as that comes again within that while; but a reading out of range is
// told as what else is found, since noise and spikes reach beyond the range too. Where every transducer whose noise
// should show repeats its reading, or stands at an end of its range, the source is held: one trouble, and not one a
// channel. An end of the range is trouble where nothing else comes for a while: a transducer that lost its cable.
// Setpoints and ground truth are not watched.
#pragma once

#include <vector>

#include "faultline/estimators/estimate.h"
#include "faultline/rig/datasheet.h"

namespace faultline {

class BadChannels {
 public:
  explicit BadChannels(const Datasheet& sheet);
  void reset();
  void process(double time, const std::vector<ChannelStatus>& status);

  bool is_bad(std::size_t channel) const { return channels_[channel].bad; }
  ChannelStatus trouble(std::size_t channel) const { return channels_[channel].trouble; }  // good: none
  double last_bad(std::size_t channel) const { return channels_[channel].last_bad; }       // s; of one that was bad
  bool held() const { return held_; }                                                      // all of them
  double last_held() const { return last_held_; }                                          // s
  // Whether any channel is bad, and since when [s].
  bool any_bad() const { return any_bad_; }
  double bad_since() const { return bad_since_; }
  // Whether the numbers are held, in another unit, or an end of the range.
  bool unusable() const { return unusable_; }

 private:
  struct Watched {
    bool watched = true, noisy = false;  // noisy: its noise is declared
    bool bad = false;
    ChannelStatus trouble = ChannelStatus::good;
    double since = 0, last_bad = 0, last_trouble = 0;
    double last_within = 0;  // s, the last reading that was not at an end of the range
  };
  bool all_held(const std::vector<ChannelStatus>& status) const;

  double hold_;    // s without a bad number
  double at_end_;  // s at an end of the range
  std::vector<Watched> channels_;
  bool held_ = false, any_bad_ = false, unusable_ = false;
  double held_since_ = 0, last_held_ = 0, bad_since_ = 0;
};

}  // namespace faultline
