#include "faultline/alarms/alarm.h"

#include <algorithm>
#include <tuple>

#include <fmt/format.h>

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

std::string told_size(const Alarm& alarm) {
  if (!alarm.has_size) return {};
  const std::string unit = alarm.size_unit == "1" || alarm.size_unit.empty() ? "" : " " + alarm.size_unit;
  if (!(alarm.low < alarm.high)) return fmt::format("{:.3g}{}", alarm.size, unit);
  std::string size, low, high;
  for (int digits = 3; digits <= 6 && (size == low || size == high || low == high); ++digits) {
    size = fmt::format("{:.{}g}", alarm.size, digits);
    low = fmt::format("{:.{}g}", alarm.low, digits);
    high = fmt::format("{:.{}g}", alarm.high, digits);
  }
  return fmt::format("{}{} (90 %: {} to {})", size, unit, low, high);
}

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
  // One that ended as shortly before as this one took to be told is what it goes on with.
  const double since = now->since - (now->raised - now->since);
  const Alarm* cause =
      first_of(report, [since](const Alarm& alarm) { return names_a_cause(alarm) && alarm.until >= since; });
  return cause ? cause : now;
}

}  // namespace faultline
