// Brings together what several estimators of a rig say about the same sample, however their messages interleave: live
// they run in nodes of their own. Complete sets come out in the order of time, so that the alarm stage sees what it
// would see offline.
//
// A set that is still incomplete when a later one is complete is dropped and counted: an estimator that restarts or
// lost its sample will not bring it any more. At most kMostWaiting sets wait; then the oldest is dropped. One estimator
// passes straight through.
//
// Stages that speak only now and then (EstimatorType::occasional) are never waited for: what they said last, when the
// first stage that always speaks said its word on the sample, stands in every set, an empty estimate until they spoke.
// Their node, which is that stage's, sends them ahead of its others of the same sample.
#pragma once

#include <cstdint>
#include <deque>
#include <utility>
#include <vector>

#include "faultline/estimators/estimate.h"
#include "faultline/rig/datasheet.h"

namespace faultline {

class EstimateJoin {
 public:
  static constexpr std::size_t kMostWaiting = 100000;  // ten seconds at 10 kHz

  explicit EstimateJoin(std::size_t stages) : EstimateJoin(std::vector<bool>(stages, false)) {}
  // One flag per stage: it speaks only now and then. At least one does not.
  explicit EstimateJoin(std::vector<bool> occasional);

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
  std::vector<bool> occasional_;
  std::vector<Estimate> last_;
  std::deque<Set> waiting_;  // in the order in which their first estimate came
  std::uint64_t dropped_ = 0;
};

// For each of the datasheet's estimators whether its messages come now and then only. The first one's never do,
// whatever its type: the alarm stage takes time and the state of the channels from it.
std::vector<bool> occasional_stages(const Datasheet& sheet);

}  // namespace faultline
