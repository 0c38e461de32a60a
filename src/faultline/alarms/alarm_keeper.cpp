#include "faultline/alarms/alarm_keeper.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "faultline/isolation/isolation_stage.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

std::string name_of(const Finding& finding) { return finding.effect + "@" + finding.port; }

bool same_words(const Finding& a, const Finding& b) {
  return a.kind == b.kind && a.effect == b.effect && a.port == b.port && a.text == b.text &&
         a.equivalent == b.equivalent && a.size_name == b.size_name && a.size_unit == b.size_unit;
}

// What a detection says beside the words.
void copy_detection(const Detection& detection, Finding& finding) {
  finding.has_size = detection.has_size;
  finding.size = detection.size;
  finding.low = detection.low;
  finding.high = detection.high;
}

}  // namespace

AlarmKeeper::AlarmKeeper(const Datasheet& sheet, const AlarmOptions& options)
    : rig_(sheet.rig), isolating_(sheet.isolators.size()), data_(sheet, options), book_(options.most_alarms) {
  for (const StageSpec& spec : sheet.detectors) {
    Detecting d;
    d.finding = meaning_of(spec);
    d.withheld.stage = spec.name;
    detecting_.push_back(std::move(d));
  }
  for (std::size_t i = 0; i < isolating_.size(); ++i) isolating_[i].withheld.stage = sheet.isolators[i].name;
  book_.report.rig = rig_;
}

void AlarmKeeper::reset() {
  const auto forget = [](Source& source) {
    source.alarm = -1;
    source.withheld.reason = Reason::absent;
  };
  for (Detecting& d : detecting_) {
    forget(d);
    d.unobserved = -1;
  }
  for (Isolating& i : isolating_) {
    forget(i);
    i.shown_for = -1;
  }
  data_.reset();
  book_.clear();
  running_ = idle_ = false;
}

void AlarmKeeper::advance(double now) {
  if (running_ || data_.any_heard()) data_.advance(data_.latest(last_time_), now, book_);
}

void AlarmKeeper::check(const Assessment& a) const {
  const auto ask = [this](const char* what, std::size_t there, std::size_t wanted) {
    if (there != wanted)
      throw InputError(fmt::format("{}: {} {} were assessed, its datasheet has {}", rig_, there, what, wanted));
  };
  ask("detectors", a.detectors.size(), detecting_.size());
  ask("isolators", a.isolators.size(), isolating_.size());
  for (std::size_t d = 0; d < detecting_.size() && !a.quiet; ++d)
    if (const int from = a.detectors[d].takes_over; from >= static_cast<int>(isolating_.size()))
      throw InputError(fmt::format("{}: there is no isolator {}", rig_, from));
  for (const IsolatorResult& i : a.isolators)
    if (i.detector >= static_cast<int>(detecting_.size()))
      throw InputError(fmt::format("{}: there is no detector {}", rig_, i.detector));
}

void AlarmKeeper::process(const Assessment& a) {
  check(a);
  if (running_ && a.time < last_time_) reset();
  if (!running_) {
    running_ = true;
    last_time_ = a.time;
  }
  data_.arrived(last_time_, a.time, book_);
  last_time_ = book_.report.time = a.time;
  book_.report.judged = a.judged;
  book_.report.undecided_since = a.undecided_since;
  data_.check_channels(a.time, a.channel_status, book_);
  if (!(a.quiet && idle_)) {
    idle_ = a.quiet;
    pass_on(a);
    for (std::size_t d = 0; d < detecting_.size(); ++d) {
      take(detecting_[d], a.detectors[d], a.time);
      idle_ = idle_ && is_idle(detecting_[d]);
    }
  }
  book_.report.too_small.clear();
  for (std::size_t i = 0; i < isolating_.size(); ++i) take(isolating_[i], a.isolators[i], a);
}

void AlarmKeeper::pass_on(const Assessment& a) {
  for (std::size_t k = 0; k < detecting_.size(); ++k) {
    Detecting& d = detecting_[k];
    if (d.alarm < 0 || a.detectors[k].reason != Reason::absent) continue;
    for (std::size_t i = 0; i < isolating_.size() && d.alarm >= 0; ++i) {
      const Finding& found = a.isolators[i].finding;
      const std::vector<std::string>& alike = found.equivalent;
      const bool same = (found.effect == d.finding.effect && found.port == d.finding.port) ||
                        std::find(alike.begin(), alike.end(), name_of(d.finding)) != alike.end();
      if (isolating_[i].alarm >= 0 || a.isolators[i].reason != Reason::told || found.effect.empty() || !same) continue;
      std::swap(d.alarm, isolating_[i].alarm);
      std::swap(d.named, isolating_[i].named);
    }
  }
}

void AlarmKeeper::take(Detecting& d, const DetectorResult& result, double time) {
  const bool nothing = result.reason == Reason::absent && result.takes_over < 0 && !result.detection.blind;
  if (nothing && is_idle(d)) return;  // the usual case
  if (result.detection.blind || d.unobserved >= 0) watch_blindness(d, result, time);
  d.withheld.reason = result.reason;
  if (result.takes_over >= 0) {
    Isolating& from = isolating_[static_cast<std::size_t>(result.takes_over)];
    d.finding.equivalent = from.shown.equivalent;
    std::swap(d.alarm, from.alarm);
    std::swap(d.named, from.named);
  } else if (d.alarm < 0) {
    d.finding.equivalent.clear();
  }
  if (d.withheld.reason == Reason::told && data_.tells(d.finding.effect, d.finding.port, book_))
    d.withheld.reason = Reason::told_by_another;
  if (d.withheld.reason != Reason::told) {
    book_.end(d.alarm, time);
    if (d.withheld.reason == Reason::absent) return;
    d.withheld.kind = d.finding.kind;
    d.withheld.effect = d.finding.effect;
    d.withheld.port = d.finding.port;
    d.withheld.since = result.detection.since;
    return;
  }
  Finding& f = d.finding;
  f.since = result.detection.since;
  f.size_name = result.size_name;
  f.size_unit = result.size_unit;
  f.confidence = result.detection.confidence;
  copy_detection(result.detection, f);
  tell(d, f, goes_by(d, f) ? 0 : kNamed, time);
}

void AlarmKeeper::take(Isolating& i, const IsolatorResult& result, const Assessment& a) {
  if (!result.finding.too_small.empty()) book_.report.too_small = result.finding.too_small;
  i.withheld.reason = result.reason;
  const bool told = result.reason == Reason::told;
  if (result.detector >= 0) {
    const auto place = static_cast<std::size_t>(result.detector);
    const Finding& shown = in_words_of(result.detector, a.detectors[place], result.finding, i);
    Detecting& d = detecting_[place];
    if (result.reason == Reason::told_by_another && d.alarm >= 0)
      d.finding.equivalent = book_.at(d.alarm).equivalent = shown.equivalent;
    if (told) tell(i, shown, goes_by(i, shown) ? 0 : kNamed, a.time);
  } else if (told) {
    tell(i, with_rivals(a, i, result.finding), goes_by(i, result.finding) ? kKept : kNamed, a.time);
  }
  if (told) return;
  book_.end(i.alarm, a.time);
  if (result.reason == Reason::absent) return;
  i.withheld.kind = result.finding.kind;
  i.withheld.effect = result.finding.effect;
  i.withheld.port = result.finding.port;
  i.withheld.since = result.finding.since;
}

// By the detector's name: of what explains it equally well, that is what the rig is watched for.
const Finding& AlarmKeeper::in_words_of(int detector, const DetectorResult& found, const Finding& finding,
                                        Isolating& i) const {
  const Finding& meaning = detecting_[static_cast<std::size_t>(detector)].finding;
  Finding& f = i.shown;
  const bool own_name = finding.effect == meaning.effect && finding.port == meaning.port;
  if (i.shown_for != detector || !same_words(finding, i.shown_of)) {
    i.shown_for = detector;
    f = i.shown_of = finding;
    f.equivalent.erase(std::remove(f.equivalent.begin(), f.equivalent.end(), name_of(meaning)), f.equivalent.end());
    if (!own_name) f.equivalent.insert(f.equivalent.begin(), name_of(f));
    f.effect = meaning.effect;
    f.port = meaning.port;
    f.text = meaning.text;
    f.size_name = found.size_name;
    f.size_unit = found.size_unit;
    f.none = 0;
  }
  f.since = finding.since;
  f.confidence = found.detection.confidence;
  // The isolator's size, in the detector's words, where it weighed that very effect.
  const double per_effect = found.detection.per_effect;
  if (own_name && finding.has_size && per_effect > 0) {
    f.has_size = true;
    f.size = finding.size * per_effect;
    f.low = finding.low * per_effect;
    f.high = finding.high * per_effect;
  } else {
    copy_detection(found.detection, f);
  }
  return f;
}

const Finding& AlarmKeeper::with_rivals(const Assessment& a, Isolating& i, const Finding& finding) const {
  const Finding* beside = nullptr;
  for (std::size_t k = 0; k < isolating_.size() && !finding.effect.empty(); ++k) {
    const IsolatorResult& other = a.isolators[k];
    if (&isolating_[k] != &i && other.reason == Reason::told_by_another && other.detector < 0 && other.finding.active &&
        is_one_cause(other.finding, finding))
      beside = &other.finding;
  }
  if (beside == nullptr || beside->effect.empty()) return finding;
  Finding& f = i.shown;
  const bool new_words = i.shown_for >= 0 || !same_words(finding, i.shown_of) || i.shown_beside.empty() ||
                         !is_named(i.shown_beside.front(), beside->effect, beside->port) ||
                         !std::equal(beside->equivalent.begin(), beside->equivalent.end(), i.shown_beside.begin() + 1,
                                     i.shown_beside.end());
  if (new_words) {
    i.shown_for = -1;
    f = i.shown_of = finding;
    i.shown_beside = beside->equivalent;
    i.shown_beside.insert(i.shown_beside.begin(), name_of(*beside));
    std::vector<std::string> more;
    for (const std::string& name : i.shown_beside)
      if (name != name_of(finding) && std::find(f.equivalent.begin(), f.equivalent.end(), name) == f.equivalent.end())
        more.push_back(name);
    f.equivalent.insert(f.equivalent.end(), more.begin(), more.end());
    if (!more.empty()) f.text += fmt::format("; this motion cannot tell it from {}", fmt::join(more, ", "));
  }
  f.since = finding.since;
  f.confidence = finding.confidence;
  f.has_size = finding.has_size;
  f.size = finding.size;
  f.low = finding.low;
  f.high = finding.high;
  f.none = finding.none;
  return f;
}

bool AlarmKeeper::goes_by(const Source& source, const Finding& finding) const {
  if (source.alarm < 0 || !source.named) return false;
  const Alarm& alarm = book_.at(source.alarm);
  return alarm.effect == finding.effect && alarm.port == finding.port;
}

void AlarmKeeper::tell(Source& source, const Finding& finding, double least_confidence, double time) {
  const bool cause = finding.kind == AlarmKind::fault || finding.kind == AlarmKind::sensor;
  source.named = !cause || finding.effect.empty() || finding.confidence >= least_confidence;
  if (source.named) {
    book_.tell(source.alarm, finding, time);
    return;
  }
  Finding& f = source.unnamed;
  if (f.equivalent.size() != finding.equivalent.size() + 1 || source.unnamed_for != name_of(finding) ||
      !std::equal(finding.equivalent.begin(), finding.equivalent.end(), f.equivalent.begin() + 1)) {
    source.unnamed_for = name_of(finding);
    f.equivalent = finding.equivalent;
    f.equivalent.insert(f.equivalent.begin(), source.unnamed_for);
    f.text = f.equivalent.size() == 1 ? fmt::format("Something changed, perhaps {}", f.equivalent.front())
                                      : fmt::format("Something changed; candidates: {}", fmt::join(f.equivalent, ", "));
  }
  f.since = finding.since;
  f.confidence = finding.confidence;
  book_.tell(source.alarm, f, time);
}

void AlarmKeeper::watch_blindness(Detecting& d, const DetectorResult& result, double time) {
  if (d.unobserved < 0) {
    d.unobserved = static_cast<int>(book_.report.unobserved.size());
    book_.report.unobserved.push_back({d.withheld.stage, d.finding.effect, d.finding.port, 0, false});
    d.watched_to = time;
  }
  Unobserved& unobserved = book_.report.unobserved[static_cast<std::size_t>(d.unobserved)];
  if (result.detection.blind) unobserved.seconds += time - d.watched_to;
  unobserved.now = result.detection.blind;
  d.watched_to = time;
}

const AlarmReport& AlarmKeeper::report() const {
  AlarmReport& report = book_.report;
  report.verdict = verdict();
  report.withheld.clear();
  const auto add = [&](const Source& s) {
    if (s.withheld.reason != Reason::told && s.withheld.reason != Reason::absent) report.withheld.push_back(s.withheld);
  };
  for (const Detecting& d : detecting_) add(d);
  for (const Isolating& i : isolating_) add(i);
  return report;
}

std::string AlarmKeeper::verdict() const {
  const AlarmReport& report = book_.report;
  const Alarm* first = headline_now(report);
  if (!first && report.alarms.empty() && !report.judged)
    return "Nothing could be judged yet: the rig stands still, or just began.";
  if (!first) {
    std::string text = report.alarms.empty() ? "No fault found" : "No fault now; there were alarms before";
    if (!std::isnan(report.undecided_since))
      text += fmt::format("; something may be wrong for {:.0f} s and is not confirmed",
                          report.time - report.undecided_since);
    return text + ".";
  }
  const auto active =
      std::count_if(report.alarms.begin(), report.alarms.end(), [](const Alarm& alarm) { return alarm.active; });
  std::string text = first->text + (first->has_size ? " " : "") + told_size(*first) + ".";
  if (active > 1) text += fmt::format(" {} more alarm{}.", active - 1, active > 2 ? "s" : "");
  return text;
}

}  // namespace faultline
