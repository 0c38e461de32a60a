#include "faultline/alarms/alarm.h"

#include <algorithm>
#include <tuple>

namespace faultline {
namespace {

// Greater comes first.
auto precedence(const Alarm& alarm) {
  const double duration = alarm.until - alarm.since;
  return std::make_tuple(alarm.active, alarm.active && alarm.level == AlarmLevel::stale, -static_cast<int>(alarm.kind),
                         alarm.confidence * duration, duration);
}

}  // namespace

AlarmLevel worst(const AlarmReport& report) {
  AlarmLevel level = AlarmLevel::ok;
  for (const Alarm& alarm : report.alarms)
    if (alarm.active) level = std::max(level, alarm.level);
  return level;
}

const Alarm* headline(const AlarmReport& report) {
  const auto first = std::max_element(report.alarms.begin(), report.alarms.end(),
                                      [](const Alarm& a, const Alarm& b) { return precedence(a) < precedence(b); });
  return first == report.alarms.end() ? nullptr : &*first;
}

}  // namespace faultline
