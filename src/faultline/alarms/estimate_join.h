// Brings together what several estimators of a rig say about the same sample, however their messages interleave: live they run in
// nodes of their own. Complete sets come out in the order of time, so that the alarm stage sees what it would see offline.
//
// A set that is still incomplete when a later one is complete is dropped and counted: an estimator that restarts or lost its sample
// will not bring it any more. At most kMostWaiting sets wait; then the oldest is dropped. One estimator passes straight through.
#pragma once

#include <cstdint>
#include <deque>
#include <vector>

#include "faultline/estimators/estimate.h"

namespace faultline {

class EstimateJoin {
 public:
  static constexpr std::size_t kMostWaiting = 10000;  // ten seconds at 1 kHz

  explicit EstimateJoin(std::size_t stages) : stages_(stages) {}

  // Takes the estimate of one stage. True: `set` holds the estimates of all stages for its sample.
  bool add(std::size_t stage, Estimate estimate, std::vector<Estimate>& set);
  void reset() { waiting_.clear(); }
  std::uint64_t dropped() const { return dropped_; }

 private:
  struct Set {
    std::uint64_t sequence;
    double time;
    std::vector<Estimate> estimates;
    std::vector<bool> there;
  };
  std::size_t stages_;
  std::deque<Set> waiting_;  // in the order in which their first estimate came
  std::uint64_t dropped_ = 0;
};

}  // namespace faultline
