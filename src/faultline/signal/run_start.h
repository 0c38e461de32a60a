// How many samples of a run went by before the first one that is here, for a listener or a recording that began late.
//
//   missed = max(round((t - t0)/T), n)    t, n: stamp and number of the first sample here; t0: stamp of the run's first
//                                         sample, as the run's description says; T: period
//
// Sources count from 0, so the number alone tells it where t0 is not known; then it is no more than the source's count,
// and a DAQ may have counted for days before anybody listened (`certain` leaves it out). Each description that gives a
// t0 begins a run. Assumes that the run's period is T. Fails: samples lost between the start and the first one here are
// taken for missed, too.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "faultline/signal/sample.h"

namespace faultline {

class RunStart {
 public:
  explicit RunStart(double period) : period_(period) {}

  // `start`: s, t0; 0 where it is not known.
  void describe(double start) { start_ = start; }

  void add(const Sample& sample) {
    if (start_ <= 0 && any_) return;
    const double late = start_ > 0 ? std::clamp(std::round((sample.time - start_) / period_), 0.0, 1e15) : 0;
    const std::uint64_t missed = std::max(static_cast<std::uint64_t>(late), sample.sequence);
    missed_ += missed;
    if (start_ > 0) certain_ += missed;
    start_ = 0;
    any_ = true;
  }

  std::uint64_t missed() const { return missed_; }
  std::uint64_t certain() const { return certain_; }

 private:
  double period_;
  double start_ = 0;
  bool any_ = false;
  std::uint64_t missed_ = 0, certain_ = 0;
};

}  // namespace faultline
