#include "nodes/alarm_diagnostics.h"

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace faultline {
namespace {

using diagnostic_msgs::DiagnosticStatus;

void add(DiagnosticStatus& status, const std::string& key, const std::string& value) {
  diagnostic_msgs::KeyValue entry;
  entry.key = key;
  entry.value = value;
  status.values.push_back(entry);
}

std::string title(const std::string& name, const Alarm& alarm) {
  std::string text = name + ": " + to_string(alarm.kind);
  if (!alarm.effect.empty()) text += " " + alarm.effect;
  if (!alarm.port.empty()) text += " at " + alarm.port;
  return text;
}

diagnostic_msgs::DiagnosticStatus closed(const std::string& name, const std::string& hardware_id) {
  DiagnosticStatus status;
  status.name = name;
  status.hardware_id = hardware_id;
  status.level = DiagnosticStatus::OK;
  status.message = "over: no longer reported";
  return status;
}

// Which of the alarms of one title this is: one that began while others of that title were there has a number of its
// own, and one that began later takes the lowest that is free.
std::vector<int> numbers(const std::vector<Alarm>& alarms, const std::vector<std::string>& titles) {
  std::vector<int> numbers(alarms.size(), 1);
  for (std::size_t k = 0; k < alarms.size(); ++k) {
    const auto taken = [&](int number) {
      for (std::size_t other = 0; other < k; ++other)
        if (numbers[other] == number && titles[other] == titles[k] &&
            (alarms[other].active || alarms[other].until > alarms[k].raised))
          return true;
      return false;
    };
    while (taken(numbers[k])) ++numbers[k];
  }
  return numbers;
}

}  // namespace

diagnostic_msgs::DiagnosticArray to_diagnostics(const AlarmReport& report, const std::string& name) {
  diagnostic_msgs::DiagnosticArray array;
  DiagnosticStatus whole;
  whole.name = name + ": verdict";
  whole.hardware_id = report.rig;
  const bool unjudged = !report.judged && report.alarms.empty();
  whole.level =
      unjudged ? static_cast<std::uint8_t>(DiagnosticStatus::STALE) : static_cast<std::uint8_t>(worst(report));
  whole.message = report.verdict;
  const auto active =
      std::count_if(report.alarms.begin(), report.alarms.end(), [](const Alarm& alarm) { return alarm.active; });
  add(whole, "active alarms", fmt::format("{}", active));
  add(whole, "alarms since the start", fmt::format("{}", report.alarms.size()));
  add(whole, "last sample [s]", fmt::format("{:.6f}", report.time));
  for (const Withheld& w : report.withheld)
    add(whole, fmt::format("withheld: {} {}@{} ({})", to_string(w.kind), w.effect, w.port, w.stage), text_of(w.reason));
  array.status.push_back(whole);

  std::vector<std::string> titles;
  for (const Alarm& alarm : report.alarms) titles.push_back(title(name, alarm));
  const std::vector<int> number = numbers(report.alarms, titles);
  for (std::size_t k = 0; k < report.alarms.size(); ++k) {
    const Alarm& alarm = report.alarms[k];
    DiagnosticStatus status;
    status.name = number[k] > 1 ? fmt::format("{} ({})", titles[k], number[k]) : titles[k];
    status.hardware_id = report.rig;
    status.level =
        alarm.active ? static_cast<std::uint8_t>(alarm.level) : static_cast<std::uint8_t>(DiagnosticStatus::OK);
    status.message = alarm.active ? alarm.text : "over: " + alarm.text;
    add(status, "since [s]", fmt::format("{:.6f}", alarm.since));
    add(status, "raised [s]", fmt::format("{:.6f}", alarm.raised));
    add(status, "until [s]", fmt::format("{:.6f}", alarm.until));
    add(status, "confidence", fmt::format("{:.3f}", alarm.confidence));
    if (!alarm.equivalent.empty())
      add(status, alarm.kind == AlarmKind::unknown ? "candidates" : "equivalent",
          fmt::format("{}", fmt::join(alarm.equivalent, ", ")));
    if (alarm.has_size) {
      add(status, fmt::format("{} [{}]", alarm.size_name, alarm.size_unit), fmt::format("{:.6g}", alarm.size));
      add(status, "low", fmt::format("{:.6g}", alarm.low));
      add(status, "high", fmt::format("{:.6g}", alarm.high));
    }
    // One status a name: the worst wins, of equals the latest.
    const auto same = std::find_if(array.status.begin(), array.status.end(),
                                   [&](const DiagnosticStatus& other) { return other.name == status.name; });
    if (same == array.status.end())
      array.status.push_back(status);
    else if (status.level >= same->level)
      *same = status;
  }
  return array;
}

void ClosedStatuses::close(diagnostic_msgs::DiagnosticArray& array) {
  std::set<std::string> now;
  for (const DiagnosticStatus& status : array.status) now.insert(status.name);
  for (const std::string& name : shown_) {
    if (now.count(name) > 0) continue;
    array.status.push_back(closed(name, array.status.front().hardware_id));
  }
  shown_.insert(now.begin(), now.end());
}

diagnostic_msgs::DiagnosticArray ClosedStatuses::all(const std::string& hardware_id) const {
  diagnostic_msgs::DiagnosticArray array;
  for (const std::string& name : shown_) array.status.push_back(closed(name, hardware_id));
  return array;
}

}  // namespace faultline
