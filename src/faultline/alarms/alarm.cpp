#include "faultline/alarms/alarm.h"

#include <algorithm>
#include <tuple>

namespace faultline {
namespace {

bool names_a_cause(const Alarm& alarm) { return alarm.kind == AlarmKind::fault || alarm.kind == AlarmKind::sensor; }

// Greater comes first.
auto precedence(const Alarm& alarm) {
  const double duration = alarm.until - alarm.since;
  return std::make_tuple(alarm.active && alarm.level == AlarmLevel::stale, -static_cast<int>(alarm.kind),
                         alarm.confidence * duration, duration);
}

template <class Counts>
const Alarm* first_of(const AlarmReport& report, const Counts& counts) {
  const Alarm* first = nullptr;
  for (const Alarm& alarm : report.alarms)
    if (counts(alarm) && (!first || precedence(alarm) > precedence(*first))) first = &alarm;
  return first;
}

}  // namespace

AlarmLevel worst(const AlarmReport& report) {
  AlarmLevel level = AlarmLevel::ok;
  for (const Alarm& alarm : report.alarms)
    if (alarm.active) level = std::max(level, alarm.level);
  return level;
}

const Alarm* headline_now(const AlarmReport& report) {
  return first_of(report, [](const Alarm& alarm) { return alarm.active; });
}

const Alarm* headline(const AlarmReport& report) {
  const Alarm* now = headline_now(report);
  if (!now) return first_of(report, [](const Alarm&) { return true; });
  if (now->kind != AlarmKind::model && now->kind != AlarmKind::unknown) return now;
  if (!now->equivalent.empty()) return now;
  const Alarm* cause =
      first_of(report, [now](const Alarm& alarm) { return names_a_cause(alarm) && alarm.until >= now->since; });
  return cause ? cause : now;
}

}  // namespace faultline
