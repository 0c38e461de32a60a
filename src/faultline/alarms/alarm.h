// An alarm: what a person sees. Dumb data.
#pragma once

#include <string>
#include <vector>

namespace faultline {

enum class AlarmLevel { ok = 0, warning = 1, error = 2, stale = 3 };  // as in diagnostic_msgs/DiagnosticStatus

struct Alarm {
  std::string kind;    // fault | sensor | data | model | unknown
  std::string effect;  // of effects.md; empty where none is claimed
  std::string port;    // of the datasheet; empty where none is claimed
  AlarmLevel level = AlarmLevel::ok;
  double since = 0;   // s, of the samples' clock: when the condition began
  double raised = 0;  // s, when it was first reported; what a detection delay is counted to
  double until = 0;   // s, when it ended; while active: the last sample
  bool active = false;
  bool has_size = false;
  std::string size_name, size_unit;
  double size = 0, low = 0, high = 0;   // 90 % bounds
  double confidence = 0;                // 0..1
  std::string text;                     // one sentence
  std::vector<std::string> equivalent;  // effect@port of what it cannot be told from
};

// What a detector looks for but could not have seen for some time: the motion did not show it.
struct Unobserved {
  std::string detector, effect, port;
  double seconds = 0;  // altogether
  bool now = false;
};

struct AlarmReport {
  std::string rig;
  double time = 0;            // s, of the last sample
  std::string verdict;        // one sentence
  std::vector<Alarm> alarms;  // in the order in which they were raised, ended ones included
  std::vector<Unobserved> unobserved;
};

// Worst first: stale data hides everything else, then errors, then warnings.
AlarmLevel worst(const AlarmReport& report);

}  // namespace faultline
