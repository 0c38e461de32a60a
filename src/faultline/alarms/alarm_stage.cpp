#include "faultline/alarms/alarm_stage.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "faultline/signal/error.h"
#include "faultline/signal/text.h"

namespace faultline {
namespace {

// s, after which a detector that does not say when it can judge has judged.
constexpr double kLongEnough = 5;

std::size_t stage_of(const Datasheet& sheet, const StageSpec& spec) {
  return spec.settings.has("stage") ? sheet.estimator(spec.settings.word("stage")) : 0;
}

bool yes_or_no(const StageSpec& spec, const std::string& key, bool fallback) {
  const std::string word = spec.settings.word_or(key, fallback ? "yes" : "no");
  if (word != "yes" && word != "no")
    throw InputError(fmt::format("{}: '{}' is '{}'; it must be yes or no", spec.settings.where(), key, word));
  return word == "yes";
}

std::string size_text(const Alarm& alarm) {
  if (!alarm.has_size) return "";
  return fmt::format(" {:.3g} {} (90 %: {:.3g} to {:.3g})", alarm.size, alarm.size_unit == "1" ? "" : alarm.size_unit,
                     alarm.low, alarm.high);
}

std::string named(const std::string& effect, const std::string& port) { return effect + "@" + port; }

// Whether `name` is effect@port, without making that string.
bool is_named(const std::string& name, const std::string& effect, const std::string& port) {
  const std::size_t at = effect.size();
  return name.size() == at + 1 + port.size() && name[at] == '@' && name.compare(0, at, effect) == 0 &&
         name.compare(at + 1, port.size(), port) == 0;
}

bool among(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

bool same_words(const Finding& a, const Finding& b) {
  return a.kind == b.kind && a.effect == b.effect && a.port == b.port && a.text == b.text &&
         a.equivalent == b.equivalent && a.size_name == b.size_name && a.size_unit == b.size_unit;
}

}  // namespace

AlarmStage::AlarmStage(const Datasheet& sheet, const AlarmOptions& options)
    : sheet_(sheet), data_(sheet, options), book_(options.most_alarms) {
  for (const StageSpec& spec : sheet_.detectors) {
    Watched w;
    w.name = spec.name;
    w.finding.kind = parse_alarm_kind(spec.settings.word("kind"), spec.settings.where());
    w.finding.effect = spec.settings.word_or("effect", "");
    w.finding.port = spec.settings.word_or("port", "");
    w.finding.text = spec.settings.word("text");
    w.named = named(w.finding.effect, w.finding.port);
    w.stage = stage_of(sheet_, spec);
    w.withholds = w.finding.kind == AlarmKind::unknown && yes_or_no(spec, "withholds_faults", true);
    if (w.finding.kind == AlarmKind::sensor)
      for (const Port& port : sheet_.ports)
        if (port.name == w.finding.port && port.kind == PortKind::sensor)
          w.doubts.push_back(static_cast<std::size_t>(sheet_.channel(port.channel)));
    for (const std::string& channel : split_words(spec.settings.word_or("doubts", "")))
      w.doubts.push_back(static_cast<std::size_t>(sheet_.channel(channel)));
    w.detector = make_detector(sheet_, spec);
    spec.settings.check_used();
    watched_.push_back(std::move(w));
  }
  for (const StageSpec& spec : sheet_.isolators) {
    Isolated isolated;
    isolated.name = spec.name;
    isolated.stage = stage_of(sheet_, spec);
    isolated.isolator = make_isolator(sheet_, spec);
    spec.settings.check_used();
    isolated_.push_back(std::move(isolated));
  }
  doubted_.assign(sheet_.channels.size(), false);
  book_.report.rig = sheet_.rig;
}

void AlarmStage::reset() {
  for (Watched& w : watched_) {
    w.detector->reset();
    w.detection = Detection();
    w.reason = Reason::absent;
    w.alarm = w.unobserved = -1;
  }
  for (Isolated& i : isolated_) {
    i.isolator->reset();
    i.finding = Finding();
    i.reason = Reason::absent;
    i.alarm = i.told_for = i.shown_for = -1;
  }
  data_.reset();
  model_fits_ = true;
  book_.clear();
  running_ = false;
}

References AlarmStage::references() const {
  References references;
  references.rig = sheet_.rig;
  const auto add = [&](const std::string& stage, std::optional<Reference> reference) {
    if (reference) references.stages.push_back({stage, std::move(*reference)});
  };
  for (const Watched& w : watched_) add(w.name, w.detector->reference());
  for (const Isolated& i : isolated_) add(i.name, i.isolator->reference());
  return references;
}

void AlarmStage::restore(const References& references) {
  for (const auto& [stage, reference] : references.stages) {
    if (std::any_of(sheet_.estimators.begin(), sheet_.estimators.end(),
                    [&name = stage](const StageSpec& spec) { return spec.name == name; }))
      continue;
    const auto of_this = [&name = stage](const Source& source) { return source.name == name; };
    const auto w = std::find_if(watched_.begin(), watched_.end(), of_this);
    const auto i = std::find_if(isolated_.begin(), isolated_.end(), of_this);
    try {
      if (w != watched_.end())
        w->detector->restore(reference);
      else if (i != isolated_.end())
        i->isolator->restore(reference);
      else
        throw InputError(fmt::format("the rig {} has no such detector or isolator; learn it anew", sheet_.rig));
    } catch (const InputError& error) {
      throw InputError(
          fmt::format("{}{}{}: {}", references.file, references.file.empty() ? "" : ": ", stage, error.what()));
    }
  }
}

void AlarmStage::advance(double now) {
  if (running_) data_.advance(last_time_, now, book_);
}

void AlarmStage::process(const std::vector<Estimate>& estimates) {
  if (estimates.size() != std::max<std::size_t>(sheet_.estimators.size(), 1))
    throw InputError(fmt::format("{}: alarms need the estimates of all {} estimators, there are {}", sheet_.rig,
                                 sheet_.estimators.size(), estimates.size()));
  process(estimates.data());
}

void AlarmStage::process(const Estimate& estimate) {
  if (sheet_.estimators.size() > 1)
    throw InputError(fmt::format("{}: alarms need the estimates of all {} estimators, there is one", sheet_.rig,
                                 sheet_.estimators.size()));
  process(&estimate);
}

void AlarmStage::process(const Estimate* estimates) {
  const Estimate& estimate = estimates[0];
  if (running_ && estimate.time < last_time_) reset();
  if (!running_) {
    running_ = true;
    begin_ = last_time_ = estimate.time;
  }
  data_.arrived(last_time_, estimate.time, book_);
  last_time_ = book_.report.time = estimate.time;
  data_.check_channels(estimate, book_);
  detect(estimates);
  isolate(estimates);
  hand_over();
  tell_detections(estimate.time);
  tell_findings(estimate.time);
}

void AlarmStage::detect(const Estimate* estimates) {
  model_fits_ = true;
  const double age = last_time_ - begin_;
  for (std::size_t c = 0; c < doubted_.size(); ++c) doubted_[c] = data_.is_bad(c);
  const auto doubt = [this](const Watched& w) {
    for (const std::size_t channel : w.doubts) doubted_[channel] = true;
  };
  for (Watched& w : watched_) {
    w.detector->process(estimates[w.stage], w.detection);
    const bool of_transducer = w.finding.kind == AlarmKind::sensor || w.finding.kind == AlarmKind::data;
    if (!book_.report.judged && !of_transducer && age > 0)
      book_.report.judged = std::isfinite(w.detector->criterion().value) || age >= kLongEnough;
    if (w.detection.blind || w.unobserved >= 0) watch_blindness(w, estimates[0].time);
    if (w.withholds && w.detection.active) model_fits_ = false;
    if (w.detection.active && w.finding.kind == AlarmKind::sensor) doubt(w);
  }
  for (Watched& w : watched_) {
    w.stands = false;
    if (w.claims_nothing()) continue;
    w.claim = Claim();
    w.claim.kind = w.finding.kind;
    w.claim.holds = w.detection.active;
    w.claim.raised = w.alarm >= 0;
    w.claim.in_doubt = std::any_of(w.doubts.begin(), w.doubts.end(), [this](std::size_t c) { return doubted_[c]; });
    w.stands = reason_of(w.claim) == Reason::told;
  }
  for (const Watched& w : watched_)
    if (w.stands && w.finding.kind == AlarmKind::fault) doubt(w);
}

void AlarmStage::isolate(const Estimate* estimates) {
  for (Isolated& i : isolated_) {
    i.isolator->process(estimates[i.stage], doubted_, i.finding);
    const double until = i.isolator->judged_until();
    book_.report.judged = book_.report.judged || (std::isfinite(until) && until > begin_);
    // What was raised while the data were good stays.
    i.on_bad_data = i.isolator->rests_on_all_channels() && data_.any_bad() &&
                    (i.alarm < 0 || book_.at(i.alarm).raised >= data_.bad_since());
  }
  // The model is then known well enough: the cause explains what it did not.
  if (std::any_of(isolated_.begin(), isolated_.end(), [](const Isolated& i) { return i.names_the_cause(); }))
    model_fits_ = true;
}

void AlarmStage::tell_detections(double time) {
  for (Watched& w : watched_) {
    w.reason = Reason::absent;
    if (w.claims_nothing()) continue;
    w.claim.raised = w.alarm >= 0;
    w.claim.model_fits = model_fits_;
    if (w.stands) {
      w.claim.explained = explained(w);
      w.claim.judgement_awaited = judgement_awaited(w);
      w.claim.told_by_another = told_by_isolator(w) || data_.tells(w.finding.effect, w.finding.port, book_);
    }
    w.reason = reason_of(w.claim);
    if (w.reason != Reason::told) {
      book_.end(w.alarm, time);
      continue;
    }
    Finding& f = w.finding;
    if (w.alarm < 0) {
      f.equivalent.clear();
      f.size_name = w.detector->size_name();
      f.size_unit = w.detector->size_unit();
    }
    f.since = w.detection.since;
    f.has_size = w.detection.has_size;
    f.size = w.detection.size;
    f.low = w.detection.low;
    f.high = w.detection.high;
    f.confidence = w.detection.confidence;
    book_.tell(w.alarm, f, time);
  }
}

void AlarmStage::tell_findings(double time) {
  for (Isolated& i : isolated_) {
    Watched* w = i.names_the_cause() ? detected(i.finding) : nullptr;
    i.claim = Claim();
    i.claim.kind = i.finding.kind;
    i.claim.holds = i.finding.active;
    i.claim.raised = i.alarm >= 0;
    i.claim.on_bad_data = i.on_bad_data;
    i.claim.told_by_another = (w && w->alarm >= 0) || told_by_another(i);
    i.claim.model_fits = model_fits_ || !i.isolator->rests_on_model();
    i.reason = reason_of(i.claim);
    if (!w) {
      i.told_for = -1;
      if (i.reason == Reason::told)
        book_.tell(i.alarm, i.finding, time);
      else
        book_.end(i.alarm, time);
      continue;
    }
    // By the detector's name: of what explains it equally well, that is what the rig is watched for.
    Finding& f = i.shown;
    const bool own_name = i.finding.effect == w->finding.effect && i.finding.port == w->finding.port;
    const auto place = static_cast<int>(w - watched_.data());
    if (i.shown_for != place || !same_words(i.finding, i.shown_of)) {
      i.shown_for = place;
      f = i.shown_of = i.finding;
      f.equivalent.erase(std::remove(f.equivalent.begin(), f.equivalent.end(), w->named), f.equivalent.end());
      if (!own_name) f.equivalent.insert(f.equivalent.begin(), named(f.effect, f.port));
      f.effect = w->finding.effect;
      f.port = w->finding.port;
      f.text = w->finding.text;
      f.size_name = w->detector->size_name();
      f.size_unit = w->detector->size_unit();
    }
    if (i.reason == Reason::told_by_another) {
      w->finding.equivalent = book_.at(w->alarm).equivalent = f.equivalent;
      continue;
    }
    i.told_for = place;
    if (i.reason != Reason::told) continue;
    f.since = i.finding.since;
    f.confidence = w->detection.confidence;
    f.none = 0;
    // The isolator's size, in the detector's words, where it weighed that very effect.
    const double per_effect = w->detection.per_effect;
    if (own_name && i.finding.has_size && per_effect > 0) {
      f.has_size = true;
      f.size = i.finding.size * per_effect;
      f.low = i.finding.low * per_effect;
      f.high = i.finding.high * per_effect;
    } else {
      f.has_size = w->detection.has_size;
      f.size = w->detection.size;
      f.low = w->detection.low;
      f.high = w->detection.high;
    }
    book_.tell(i.alarm, f, time);
  }
}

void AlarmStage::watch_blindness(Watched& w, double time) {
  if (w.unobserved < 0) {
    w.unobserved = static_cast<int>(book_.report.unobserved.size());
    book_.report.unobserved.push_back({w.name, w.finding.effect, w.finding.port, 0, false});
    w.watched_to = time;
  }
  Unobserved& unobserved = book_.report.unobserved[static_cast<std::size_t>(w.unobserved)];
  if (w.detection.blind) unobserved.seconds += time - w.watched_to;
  unobserved.now = w.detection.blind;
  w.watched_to = time;
}

bool AlarmStage::explained(const Watched& w) const {
  // Numbers that are not the transducers' own fit no model.
  if (w.finding.kind == AlarmKind::unknown && data_.unusable() &&
      (w.alarm < 0 || book_.report.alarms[static_cast<std::size_t>(w.alarm)].raised >= data_.bad_since()))
    return true;
  return std::any_of(isolated_.begin(), isolated_.end(), [&](const Isolated& i) {
    const Finding& f = i.finding;
    if (!i.names_the_cause() || f.kind == AlarmKind::unknown) return false;
    switch (w.finding.kind) {
      case AlarmKind::unknown:
        return true;
      case AlarmKind::sensor:
        return w.finding.effect.empty() && (f.kind == AlarmKind::sensor || f.kind == AlarmKind::data);
      case AlarmKind::fault:
        return !is_named(w.named, f.effect, f.port) && !among(f.equivalent, w.named);
      case AlarmKind::model:
      case AlarmKind::data:
        break;
    }
    return false;
  });
}

bool AlarmStage::judgement_awaited(const Watched& w) const {
  if (w.finding.kind == AlarmKind::sensor && !w.finding.effect.empty()) return false;
  if (w.finding.kind == AlarmKind::data) return false;  // what is done with a reading, whatever the cause is
  return std::any_of(isolated_.begin(), isolated_.end(), [&](const Isolated& i) {
    return i.isolator->overrules() && i.isolator->judged_until() < w.detection.since;
  });
}

bool AlarmStage::told_by_isolator(const Watched& w) const {
  return std::any_of(isolated_.begin(), isolated_.end(), [&](const Isolated& i) {
    return i.alarm >= 0 && i.names_the_cause() && detected(i.finding) == &w;
  });
}

bool AlarmStage::told_by_another(const Isolated& i) const {
  const Finding& f = i.finding;
  if (!f.active || f.effect.empty()) return false;
  return std::any_of(isolated_.begin(), isolated_.end(), [&](const Isolated& other) {
    const Finding& g = other.finding;
    return &other != &i && other.alarm >= 0 && g.active && !g.effect.empty() &&
           ((f.effect == g.effect && f.port == g.port) || among(f.equivalent, named(g.effect, g.port)) ||
            among(g.equivalent, named(f.effect, f.port)));
  });
}

void AlarmStage::hand_over() {
  for (Isolated& i : isolated_) {
    if (i.alarm < 0 || i.finding.active || i.told_for < 0) continue;
    Watched& w = watched_[static_cast<std::size_t>(i.told_for)];
    if (!w.stands || w.alarm >= 0) continue;
    w.finding.equivalent = book_.at(i.alarm).equivalent;
    w.finding.size_name = w.detector->size_name();
    w.finding.size_unit = w.detector->size_unit();
    w.alarm = i.alarm;
    i.alarm = i.told_for = -1;
  }
}

const AlarmStage::Watched* AlarmStage::detected(const Finding& finding) const {
  if (finding.effect.empty()) return nullptr;
  for (const Watched& w : watched_)
    if (w.stands && w.finding.kind == AlarmKind::fault && !w.finding.effect.empty() &&
        (is_named(w.named, finding.effect, finding.port) || among(finding.equivalent, w.named)))
      return &w;
  return nullptr;
}

AlarmStage::Watched* AlarmStage::detected(const Finding& finding) {
  return const_cast<Watched*>(static_cast<const AlarmStage*>(this)->detected(finding));
}

const AlarmReport& AlarmStage::report() const {
  AlarmReport& report = book_.report;
  report.verdict = verdict();
  report.withheld.clear();
  const auto add = [&](const Source& s, double since) {
    if (s.reason != Reason::told && s.reason != Reason::absent)
      report.withheld.push_back({s.name, s.claim.kind, s.finding.effect, s.finding.port, since, s.reason});
  };
  for (const Watched& w : watched_) add(w, w.detection.since);
  for (const Isolated& i : isolated_) add(i, i.finding.since);
  return report;
}

std::string AlarmStage::verdict() const {
  const AlarmReport& report = book_.report;
  const Alarm* first = headline_now(report);
  if (!first && report.alarms.empty() && !report.judged) return "Nothing could be judged yet.";
  if (!first) return report.alarms.empty() ? "No fault found." : "No fault now; there were alarms before.";
  const auto active =
      std::count_if(report.alarms.begin(), report.alarms.end(), [](const Alarm& alarm) { return alarm.active; });
  std::string text = first->text + size_text(*first) + ".";
  if (active > 1) text += fmt::format(" {} more alarm{}.", active - 1, active > 2 ? "s" : "");
  return text;
}

}  // namespace faultline
