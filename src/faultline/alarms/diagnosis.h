// The diagnosis of one rig in one process: samples in, alarms out, by the same stages in the same order as the nodes
// run them (the rig's estimators, then its alarm stage), and what a whole recording says in the end.
//
// A verdict over a recording is that of its headline (alarm.h): what is there at the end before what ended, then fault
// before sensor before unknown before data; healthy if there was no alarm, and not observable if there was none because
// nothing that would have shown a fault could judge.
// Limits: the alarm stage starts over when time jumps back, and what it said before is then gone (SampleCheck counts
// such jumps).
#pragma once

#include <string>
#include <vector>

#include "faultline/alarms/alarm_stage.h"
#include "faultline/estimators/estimator_stage.h"

namespace faultline {

enum class VerdictKind { healthy, fault, sensor, unknown, data, not_observable };
const char* to_string(VerdictKind kind);

struct Verdict {
  VerdictKind kind = VerdictKind::healthy;
  std::string sentence;  // one, with times in s from the recording's start
};

class Diagnosis {
 public:
  // InputError where the datasheet names no estimator.
  explicit Diagnosis(const Datasheet& sheet);

  // What the rig's stages have learnt; and, before the first sample, to judge by that (AlarmStage).
  References references() const;
  void restore(const References& references);

  // False if the sample was not used (it is not newer than the last); estimate() then is still that of the last.
  bool process(const Sample& sample);

  const Estimate& estimate(std::size_t stage = 0) const { return estimates_[stage]; }
  const AlarmReport& report() const { return alarms_.report(); }
  const EstimatorStage& estimator(std::size_t stage = 0) const { return estimators_[stage]; }
  std::size_t estimators() const { return estimators_.size(); }

 private:
  std::vector<EstimatorStage> estimators_;
  AlarmStage alarms_;
  std::vector<Estimate> estimates_;
};

// What `report` says about a recording from `start` to `end` [s, of the samples' clock].
Verdict verdict_of(const AlarmReport& report, double start, double end);

}  // namespace faultline
