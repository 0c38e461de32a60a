// The alarms of a report with their life cycle: each is raised, told anew with every sample, and ended; ended ones
// stay.
//
// Size of an alarm that ended: what is estimated while a cause fades is the size of its rest, so what stays is the
// estimate that was most certain, that is whose distance from no effect was the greatest in widths of its 90 % interval
// (without an interval: of the greatest confidence, the latest of equals).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "faultline/alarms/alarm.h"
#include "faultline/isolation/isolator.h"

namespace faultline {

class AlarmBook {
 public:
  explicit AlarmBook(std::size_t most_alarms) : most_(most_alarms) {}

  // Its index, valid while it is active.
  int raise(AlarmKind kind, const std::string& effect, const std::string& port, AlarmLevel level, double since,
            double raised, const std::string& text);
  // What is found at `time` [s], as alarm number `alarm`; raises it where that is -1.
  void tell(int& alarm, const Finding& finding, double time);
  // At `time` [s]; `alarm`, if it is one, becomes -1.
  void end(int& alarm, double time);
  // As if it had never been raised. False, and nothing is done, unless it is the latest of the report.
  bool take_back(int& alarm);
  void clear();

  Alarm& at(int alarm) { return report.alarms[static_cast<std::size_t>(alarm)]; }
  // Counts up whenever an alarm is raised, ends, or changes its name.
  std::uint64_t changes() const { return changes_; }

  AlarmReport report;

 private:
  // An estimate of an alarm's size.
  struct Size {
    double size = 0, low = 0, high = 0, confidence = 0;
    double certainty = -1;  // widths of its interval; -1: none yet, 0: no interval
  };
  void keep_size(int alarm, double none);

  std::size_t most_;
  std::vector<Size> sizes_;  // one per alarm: the most certain so far
  std::uint64_t changes_ = 0;
};

}  // namespace faultline
