// Alarms as /diagnostics shows them.
#pragma once

#include <set>
#include <string>

#include <diagnostic_msgs/DiagnosticArray.h>

#include "faultline/alarms/alarm.h"

namespace faultline {

// Of a report: the rig's verdict first, at the worst level (STALE while nothing could be judged), then one status for
// each thing that has an alarm; one that is over is OK. Alarms of one name at the same time are numbered. `name`: of
// the rig in this graph, at the front of each status, so that two of one kind differ. Pure, without stamp.
diagnostic_msgs::DiagnosticArray to_diagnostics(const AlarmReport& report, const std::string& name);

// Closes what was shown once and is no longer in the report (an alarm that got another name, a run that began anew):
// without a last OK an aggregator would hold its old level until it is stale, and then for ever.
class ClosedStatuses {
 public:
  // Adds an OK status for every name that came before and is not in `array`.
  void close(diagnostic_msgs::DiagnosticArray& array);
  // OK for every name that came, verdict and all: of a node that ends.
  diagnostic_msgs::DiagnosticArray all(const std::string& hardware_id) const;

 private:
  std::set<std::string> shown_;
};

}  // namespace faultline
