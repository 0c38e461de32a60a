#include "faultline/alarms/alarm_book.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

namespace faultline {
namespace {

constexpr double kEqual = 1e-9;  // relative difference of certainties that rounding makes

// How far from no effect, in widths of the interval. Where no effect is an infinite size, its inverse is what grows.
double certainty_of(const Alarm& alarm, double none) {
  const auto effect = [none](double size) { return std::isinf(none) ? 1 / size : size - none; };
  const double width = std::abs(effect(alarm.high) - effect(alarm.low));
  const double certainty = std::abs(effect(alarm.size)) / width;
  return width > 0 && std::isfinite(certainty) ? certainty : 0;
}

// Neither the same nor one that the other could not be told from.
bool is_another_cause(const Alarm& alarm, const Finding& f) {
  if (alarm.effect.empty() || f.effect.empty() || (alarm.effect == f.effect && alarm.port == f.port)) return false;
  const std::string before = alarm.effect + "@" + alarm.port, now = f.effect + "@" + f.port;
  const auto among = [](const std::vector<std::string>& names, const std::string& name) {
    return std::find(names.begin(), names.end(), name) != names.end();
  };
  return !among(alarm.equivalent, now) && !among(f.equivalent, before);
}

}  // namespace

int AlarmBook::raise(AlarmKind kind, const std::string& effect, const std::string& port, AlarmLevel level, double since,
                     double raised, const std::string& text) {
  Alarm alarm;
  alarm.kind = kind;
  alarm.effect = effect;
  alarm.port = port;
  alarm.level = level;
  alarm.since = alarm.until = since;
  alarm.raised = raised;
  alarm.active = true;
  alarm.text = text;
  ++changes_;
  // Indices of active alarms must stay valid, so an ended alarm gives its place.
  if (report.alarms.size() >= most_)
    for (std::size_t i = 0; i < report.alarms.size(); ++i)
      if (!report.alarms[i].active) {
        report.alarms[i] = std::move(alarm);
        sizes_[i] = Size();
        return static_cast<int>(i);
      }
  report.alarms.push_back(std::move(alarm));
  sizes_.emplace_back();
  return static_cast<int>(report.alarms.size()) - 1;
}

void AlarmBook::tell(int& number, const Finding& f, double time) {
  const AlarmLevel level = f.kind == AlarmKind::unknown ? AlarmLevel::warning : AlarmLevel::error;
  const bool another = number >= 0 && is_another_cause(at(number), f);
  // One that began after this alarm was raised is another alarm.
  if (another && f.since > at(number).raised) end(number, time);
  if (number < 0) number = raise(f.kind, f.effect, f.port, level, f.since, time, f.text);
  Alarm& alarm = at(number);
  alarm.until = time;
  if (alarm.effect != f.effect || alarm.port != f.port || alarm.size_name != f.size_name)
    sizes_[static_cast<std::size_t>(number)] = Size();
  if (another) alarm.since = f.since;
  if (alarm.effect != f.effect || alarm.port != f.port || alarm.kind != f.kind || alarm.text != f.text) {
    alarm.kind = f.kind;
    alarm.effect = f.effect;
    alarm.port = f.port;
    alarm.text = f.text;
    ++changes_;
  }
  alarm.level = level;
  alarm.equivalent = f.equivalent;
  alarm.has_size = f.has_size;
  alarm.size_name = f.size_name;
  alarm.size_unit = f.size_unit;
  alarm.size = f.size;
  alarm.low = f.low;
  alarm.high = f.high;
  alarm.confidence = f.confidence;
  keep_size(number, f.none);
}

void AlarmBook::keep_size(int number, double none) {
  const Alarm& alarm = at(number);
  Size& kept = sizes_[static_cast<std::size_t>(number)];
  if (!alarm.has_size) return;
  const double certainty = certainty_of(alarm, none);
  const bool better = certainty > 0 || kept.certainty > 0 ? certainty > kept.certainty * (1 + kEqual)
                                                          : alarm.confidence >= kept.confidence;
  if (better) kept = {alarm.size, alarm.low, alarm.high, alarm.confidence, certainty};
}

void AlarmBook::end(int& number, double time) {
  if (number < 0) return;
  Alarm& alarm = at(number);
  const Size& kept = sizes_[static_cast<std::size_t>(number)];
  alarm.active = false;
  alarm.until = time;
  if (alarm.has_size && kept.certainty >= 0) {
    alarm.size = kept.size;
    alarm.low = kept.low;
    alarm.high = kept.high;
    alarm.confidence = kept.confidence;
  }
  number = -1;
  ++changes_;
}

bool AlarmBook::take_back(int& number) {
  if (number < 0 || number != static_cast<int>(report.alarms.size()) - 1) return false;
  report.alarms.pop_back();
  sizes_.pop_back();
  number = -1;
  ++changes_;
  return true;
}

void AlarmBook::clear() {
  report.alarms.clear();
  report.unobserved.clear();
  report.judged = false;
  report.undecided_since = std::nan("");
  sizes_.clear();
  ++changes_;
}

}  // namespace faultline
