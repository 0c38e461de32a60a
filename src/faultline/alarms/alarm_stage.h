// From estimates to alarms: the rig's detectors and isolators (isolation/isolation_stage.h), then the life cycle of
// alarms and the verdict (alarm_keeper.h). Offline both run here one after the other; live each has a node.
#pragma once

#include <vector>

#include "faultline/alarms/alarm_keeper.h"
#include "faultline/isolation/isolation_stage.h"

namespace faultline {

class AlarmStage {
 public:
  explicit AlarmStage(const Datasheet& sheet, const AlarmOptions& options = {})
      : isolation_(sheet), keeper_(sheet, options) {}

  // What all estimators say about one sample, in the datasheet's order.
  void process(const std::vector<Estimate>& estimates) { keeper_.process(isolation_.process(estimates)); }
  void process(const Estimate& estimate) { keeper_.process(isolation_.process(estimate)); }  // of a rig with one
  void advance(double now) { keeper_.advance(now); }
  void reset() {
    isolation_.reset();
    keeper_.reset();
  }

  const AlarmReport& report() const { return keeper_.report(); }
  std::uint64_t changes() const { return keeper_.changes(); }
  References references() const { return isolation_.references(); }
  void restore(const References& references) { isolation_.restore(references); }

 private:
  IsolationStage isolation_;
  AlarmKeeper keeper_;
};

}  // namespace faultline
