// Which channels give bad numbers now: missing or out of range. A channel counts as bad until for a while no bad number
// came, so that a loose contact is one trouble and not one a sample. Setpoints and ground truth are not watched.
#pragma once

#include <vector>

#include "faultline/estimators/estimate.h"
#include "faultline/rig/datasheet.h"

namespace faultline {

class ChannelWatch {
 public:
  explicit ChannelWatch(const Datasheet& sheet);
  void reset();
  void process(double time, const std::vector<ChannelStatus>& status);

  bool is_bad(std::size_t channel) const { return channels_[channel].bad; }
  double last_bad(std::size_t channel) const { return channels_[channel].last_bad; }  // s; of one that is or was bad

 private:
  struct Watched {
    bool watched = true, bad = false;
    double last_bad = 0;
  };
  double hold_;  // s without a bad number
  std::vector<Watched> channels_;
};

}  // namespace faultline
