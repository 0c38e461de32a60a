#include "nodes/view_marks.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "faultline/alarms/alarm_keeper.h"
#include "nodes/view_text.h"

namespace faultline {
namespace {

constexpr double kGapIsError = 3;  // times its limit (gap_publisher.cpp)

struct Graded {
  PartMark mark;
  int rank = 0;
};

// Ports by what an alarm calls its place: a port, or the channel that passes one.
std::vector<std::string> ports_of(const Datasheet& sheet, const std::string& place) {
  std::vector<std::string> ports;
  for (const Port& port : sheet.ports)
    if (!place.empty() && (port.name == place || port.channel == place)) ports.push_back(port.name);
  return ports;
}

std::string port_of_cause(const std::string& effect_at_port) {
  return effect_at_port.substr(std::min(effect_at_port.find('@'), effect_at_port.size() - 1) + 1);
}

class Grades {
 public:
  Grades(const ViewLayout& layout, const Datasheet& sheet)
      : layout_(layout), sheet_(sheet), parts_(layout.parts.size()) {}

  void raise(const std::string& place, PartLevel level, int rank, const std::string& text) {
    for (const std::string& port : ports_of(sheet_, place))
      for (std::size_t i = 0; i < parts_.size(); ++i) {
        const std::vector<std::string>& ports = layout_.parts[i].ports;
        if (std::find(ports.begin(), ports.end(), port) == ports.end()) continue;
        Graded& part = parts_[i];
        if (part.rank >= rank) continue;
        part = {{level, text}, rank};
      }
  }
  std::vector<Graded>& parts() { return parts_; }

 private:
  const ViewLayout& layout_;
  const Datasheet& sheet_;
  std::vector<Graded> parts_;
};

std::string what_of(const faultline_msgs::Alarm& alarm) {
  if (!alarm.effect.empty()) return words_of(alarm.effect);
  if (alarm.kind == "model") return "model does not fit";
  return alarm.kind == "unknown" ? "unexplained" : alarm.kind;
}

bool names_a_cause(const faultline_msgs::Alarm& alarm) { return alarm.kind == "fault" || alarm.kind == "sensor"; }

void grade_alarm(const faultline_msgs::Alarm& alarm, Grades& grades) {
  const std::string what = what_of(alarm);
  const bool cause = names_a_cause(alarm);
  const std::string text = cause ? fmt::format("{} {:.0f} %", what, 100 * alarm.confidence) : what;
  const int rank = 2 * std::max<int>(alarm.level, 1) + 1;
  if (cause && alarm.confidence < kNamed) {
    grades.raise(alarm.port, PartLevel::candidate, 1, text + "?");
  } else {
    const bool warns = alarm.level == faultline_msgs::Alarm::WARNING;
    grades.raise(alarm.port, warns ? PartLevel::warning : PartLevel::error, rank, text);
  }
  for (const std::string& other : alarm.equivalent)
    grades.raise(port_of_cause(other), PartLevel::candidate, 1, words_of(other.substr(0, other.find('@'))) + "?");
}

std_msgs::ColorRGBA colour(double red, double green, double blue) {
  std_msgs::ColorRGBA made;
  made.r = static_cast<float>(red);
  made.g = static_cast<float>(green);
  made.b = static_cast<float>(blue);
  made.a = 1;
  return made;
}

}  // namespace

std::vector<PartMark> part_marks(const ViewLayout& layout, const Datasheet& sheet, const Judgements& heard) {
  Grades grades(layout, sheet);
  if (heard.alarms != nullptr)
    for (const faultline_msgs::Alarm& alarm : heard.alarms->alarms)
      if (alarm.active) grade_alarm(alarm, grades);
  if (heard.gap != nullptr && heard.gap->left_normal) {
    const bool error = heard.gap->worst > kGapIsError;
    grades.raise(heard.gap->port, PartLevel::gap, error ? 4 : 2, "gap: " + words_of(heard.gap->effect));
    for (const std::string& port : heard.gap->inseparable) grades.raise(port, PartLevel::candidate, 1, "gap?");
  }
  std::vector<PartMark> marks;
  for (Graded& part : grades.parts()) {
    if (part.rank == 0 && heard.alarms != nullptr && heard.alarms->judged) part.mark.level = PartLevel::healthy;
    marks.push_back(part.mark);
  }
  return marks;
}

PartLevel level_of(const faultline_msgs::AlarmArray& alarms) {
  PartLevel worst = alarms.judged ? PartLevel::healthy : PartLevel::unjudged;
  for (const faultline_msgs::Alarm& alarm : alarms.alarms)
    if (alarm.active)
      worst = std::max(
          worst, alarm.level == faultline_msgs::Alarm::WARNING || (names_a_cause(alarm) && alarm.confidence < kNamed)
                     ? PartLevel::warning
                     : PartLevel::error);
  return worst;
}

std_msgs::ColorRGBA colour_of(PartLevel level) {
  switch (level) {
    case PartLevel::unjudged:
      return colour(0.80, 0.80, 0.80);
    case PartLevel::healthy:
      return colour(0.48, 0.67, 0.82);
    case PartLevel::candidate:
      return colour(0.98, 0.91, 0.35);
    case PartLevel::gap:
      return colour(0.72, 0.40, 0.78);
    case PartLevel::warning:
      return colour(0.95, 0.60, 0.05);
    case PartLevel::error:
      return colour(0.70, 0.08, 0.10);
  }
  return colour(0, 0, 0);
}

std::string words_of(PartLevel level) {
  static const std::array words = {"not judged", "healthy", "candidate", "gap", "warning", "error"};
  return words[static_cast<std::size_t>(level)];
}

}  // namespace faultline
