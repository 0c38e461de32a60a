#include "faultline/alarms/diagnosis.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

std::vector<EstimatorStage> stages_of(const Datasheet& sheet) {
  if (sheet.estimators.empty())
    throw InputError(
        fmt::format("{}: the datasheet names no estimator, so {} cannot be diagnosed; add one under estimators",
                    sheet.file, sheet.rig));
  std::vector<EstimatorStage> stages;
  for (const StageSpec& spec : sheet.estimators) stages.emplace_back(sheet, spec);
  return stages;
}

VerdictKind verdict_of(AlarmKind kind) {
  switch (kind) {
    case AlarmKind::fault:
      return VerdictKind::fault;
    case AlarmKind::sensor:
      return VerdictKind::sensor;
    case AlarmKind::data:
      return VerdictKind::data;
    case AlarmKind::model:
    case AlarmKind::unknown:
      break;
  }
  return VerdictKind::unknown;
}

// A rig that is sampled at 10 kHz moves within its first second.
std::string seconds(double time) {
  return time >= 5e-5 && time < 1 ? fmt::format("{:.2g}", time) : fmt::format("{:.1f}", time);
}

// The sentence starts with a capital letter; a channel's name at its head stays as it is.
std::string text_of(const Alarm& alarm, double start) {
  std::string text = alarm.text;
  while (!text.empty() && text.back() == '.') text.pop_back();
  if (alarm.has_size) text += ", " + told_size(alarm);
  text += fmt::format(", since {} s", seconds(alarm.since - start));
  text += alarm.active ? ", still there at the end" : fmt::format(", until {} s", seconds(alarm.until - start));
  return text;
}

// Alarms of the same cause that began earlier, as it comes and goes; the first one first.
std::vector<const Alarm*> same_before(const AlarmReport& report, const Alarm& alarm) {
  std::vector<const Alarm*> before;
  if (alarm.effect.empty()) return before;
  for (const Alarm& other : report.alarms)
    if (&other != &alarm && other.kind == alarm.kind && other.effect == alarm.effect && other.port == alarm.port &&
        other.since < alarm.since)
      before.push_back(&other);
  std::sort(before.begin(), before.end(), [](const Alarm* a, const Alarm* b) { return a->since < b->since; });
  return before;
}

}  // namespace

Diagnosis::Diagnosis(const Datasheet& sheet) : estimators_(stages_of(sheet)), alarms_(sheet) {
  estimates_.resize(estimators_.size());
}

References Diagnosis::references() const {
  References references = alarms_.references();
  for (const EstimatorStage& stage : estimators_)
    if (std::optional<Reference> reference = stage.reference())
      references.stages.push_back({stage.name(), std::move(*reference)});
  return references;
}

void Diagnosis::restore(const References& references) {
  for (EstimatorStage& stage : estimators_) restore_stage(references, stage);
  alarms_.restore(references);
}

bool Diagnosis::process(const Sample& sample) {
  // All are set alike for gaps and jumps, so all take a sample or none does.
  bool taken = true;
  for (std::size_t i = 0; i < estimators_.size(); ++i) taken = estimators_[i].process(sample, estimates_[i]) && taken;
  if (taken) alarms_.process(estimates_);
  return taken;
}

const char* to_string(VerdictKind kind) {
  constexpr std::array<const char*, 6> kWords = {"healthy", "fault", "sensor",
                                                 "unknown", "data",  "not_observable"};  // in the enum's order
  return kWords.at(static_cast<std::size_t>(kind));
}

Verdict verdict_of(const AlarmReport& report, double start, double end) {
  const Alarm* first = headline(report);
  if (!first && !report.judged)
    return {VerdictKind::not_observable, fmt::format("Not observable: in {} s no stage could judge; the rig stood "
                                                     "still, never did where steady operation is judged, there is "
                                                     "too little, or gaps break it up.",
                                                     seconds(end - start))};
  if (!first) {
    std::string sentence = fmt::format("No fault found in {} s", seconds(end - start));
    if (!std::isnan(report.undecided_since))
      sentence += fmt::format("; something may be wrong since {} s, which the recording is too short to confirm",
                              seconds(report.undecided_since - start));
    if (!report.too_small.empty()) sentence += "; seen, but less than is told: " + report.too_small;
    return {VerdictKind::healthy, sentence + "."};
  }
  std::string sentence = text_of(*first, start);
  const std::vector<const Alarm*> before = same_before(report, *first);
  if (!before.empty())
    sentence += fmt::format("; the same{} before, first since {} s",
                            before.size() > 1 ? fmt::format(" {} times", before.size()) : "",
                            seconds(before.front()->since - start));
  const std::size_t more = report.alarms.size() - 1 - before.size();
  if (more > 0) sentence += fmt::format("; {} more alarm{}", more, more > 1 ? "s" : "");
  return {verdict_of(first->kind), sentence + "."};
}

}  // namespace faultline
