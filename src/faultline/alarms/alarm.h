// An alarm: what a person sees. Dumb data.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "faultline/isolation/reason.h"
#include "faultline/rig/alarm_kind.h"

namespace faultline {

enum class AlarmLevel { ok = 0, warning = 1, error = 2, stale = 3 };  // as in diagnostic_msgs/DiagnosticStatus

struct Alarm {
  AlarmKind kind = AlarmKind::unknown;
  std::string effect;  // of effects.md; empty where none is claimed
  std::string port;    // of the datasheet; empty where none is claimed
  AlarmLevel level = AlarmLevel::ok;
  double since = 0;   // s, of the samples' clock: when the condition began
  double raised = 0;  // s, when it was first reported; what a detection delay is counted to
  double until = 0;   // s, when it ended; while active: the last sample
  bool active = false;
  bool has_size = false;
  std::string size_name, size_unit;
  double size = 0, low = 0, high = 0;  // 90 % bounds; of an ended alarm: when it was most certain
  double confidence = 0;               // 0..1, likewise
  std::string text;                    // one sentence
  // effect@port of what it cannot be told from; of kind unknown: the candidates, the likeliest first
  std::vector<std::string> equivalent;
};

// What a detector looks for but could not have seen for some time: the motion did not show it.
struct Unobserved {
  std::string detector, effect, port;
  double seconds = 0;  // altogether
  bool now = false;
};

// What a detector or an isolator claims now but is not told.
struct Withheld {
  std::string stage;  // its name in the datasheet
  AlarmKind kind = AlarmKind::unknown;
  std::string effect, port;
  double since = 0;  // s
  Reason reason = Reason::absent;
};

struct AlarmReport {
  std::string rig;
  double time = 0;            // s, of the last sample
  std::string verdict;        // one sentence
  std::vector<Alarm> alarms;  // in the order in which they were raised, ended ones included
  std::vector<Unobserved> unobserved;
  std::vector<Withheld> withheld;
  bool judged = false;  // something that would show a fault has judged so far
  // s, since when something may be wrong that is not confirmed yet; NaN: nothing is undecided
  double undecided_since = std::numeric_limits<double>::quiet_NaN();
  std::string too_small;  // a cause that is seen, with its size, but is less than is told; empty: none
};

// The size with its unit and its bounds, with as many digits as tell them apart, three at least and six at most; empty
// where it has none.
std::string told_size(const Alarm& alarm);

// Worst first: stale data hides everything else, then errors, then warnings.
AlarmLevel worst(const AlarmReport& report);

// The alarm that a person should read first; null if there is none. Silence, which hides everything else, before what
// was known until then; then the worse kind; then the greater confidence times duration, which puts a cause that has
// stood for long before a first guess; then the longer; then the one that was raised first.
const Alarm* headline_now(const AlarmReport& report);  // of those that are active
// Of a whole recording: an active one before those that ended, unless it names neither a cause nor candidates and began
// while there was an alarm of a fault or a sensor, or as shortly after as it took to be told: then it is taken for a
// consequence, and the cause comes first.
const Alarm* headline(const AlarmReport& report);

}  // namespace faultline
