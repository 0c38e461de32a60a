#include "faultline/alarms/alarm_stage.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

std::size_t stage_of(const Datasheet& sheet, const StageSpec& spec) {
  return spec.settings.has("stage") ? sheet.estimator(spec.settings.word("stage")) : 0;
}

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> words;
  std::string word;
  for (const char c : text + ",") {
    if (c != ',') {
      if (c != ' ') word += c;
    } else if (!word.empty()) {
      words.push_back(word);
      word.clear();
    }
  }
  return words;
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

bool among(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

// How far from no effect, in widths of the interval. Where no effect is an infinite size, its inverse is what grows.
double certainty_of(const Alarm& alarm, double none) {
  const auto effect = [none](double size) { return std::isinf(none) ? 1 / size : size - none; };
  const double width = std::abs(effect(alarm.high) - effect(alarm.low));
  const double certainty = std::abs(effect(alarm.size)) / width;
  return width > 0 && std::isfinite(certainty) ? certainty : 0;
}

}  // namespace

AlarmStage::AlarmStage(const Datasheet& sheet, const AlarmOptions& options)
    : sheet_(sheet),
      options_(options),
      stale_after_(std::max(options.shortest_stale_s, options.stale_periods * sheet.sample_period)) {
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
    for (const std::string& channel : split(spec.settings.word_or("doubts", "")))
      w.doubts.push_back(static_cast<std::size_t>(sheet_.channel(channel)));
    w.detector = make_detector(spec);
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
  channels_.resize(sheet_.channels.size());
  report_.rig = sheet_.rig;
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
    i.alarm = i.told_for = -1;
  }
  std::fill(channels_.begin(), channels_.end(), ChannelWatch());
  stale_ = -1;
  running_ = false;
  report_.alarms.clear();
  report_.unobserved.clear();
  sizes_.clear();
  ++changes_;
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

int AlarmStage::raise(AlarmKind kind, const std::string& effect, const std::string& port, AlarmLevel level,
                      double since, double raised, const std::string& text) {
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
  if (report_.alarms.size() >= options_.most_alarms)
    for (std::size_t i = 0; i < report_.alarms.size(); ++i)
      if (!report_.alarms[i].active) {
        report_.alarms[i] = std::move(alarm);
        sizes_[i] = Size();
        return static_cast<int>(i);
      }
  report_.alarms.push_back(std::move(alarm));
  sizes_.emplace_back();
  return static_cast<int>(report_.alarms.size()) - 1;
}

void AlarmStage::end(int& alarm, double time) {
  if (alarm < 0) return;
  Alarm& a = report_.alarms[static_cast<std::size_t>(alarm)];
  const Size& most_certain = sizes_[static_cast<std::size_t>(alarm)];
  a.active = false;
  a.until = time;
  if (a.has_size && most_certain.certainty >= 0) {
    a.size = most_certain.size;
    a.low = most_certain.low;
    a.high = most_certain.high;
    a.confidence = most_certain.confidence;
  }
  alarm = -1;
  ++changes_;
}

void AlarmStage::keep_size(std::size_t alarm, double none) {
  const Alarm& a = report_.alarms[alarm];
  Size& kept = sizes_[alarm];
  if (!a.has_size) return;
  const double certainty = certainty_of(a, none);
  const bool better =
      certainty > 0 || kept.certainty > 0 ? certainty > kept.certainty * (1 + 1e-9) : a.confidence >= kept.confidence;
  if (better) kept = {a.size, a.low, a.high, a.confidence, certainty};
}

void AlarmStage::check_data(const Estimate& estimate) {
  for (std::size_t c = 0; c < channels_.size() && c < estimate.channel_status.size(); ++c) {
    const Channel& channel = sheet_.channels[c];
    if (channel.role == Role::setpoint || channel.ground_truth) continue;
    const ChannelStatus status = estimate.channel_status[c];
    ChannelWatch& watch = channels_[c];
    if (status != ChannelStatus::good) {
      if (watch.alarm < 0) {
        const std::string port = "sensor." + channel.name;
        const bool has_port =
            std::any_of(sheet_.ports.begin(), sheet_.ports.end(), [&](const Port& p) { return p.name == port; });
        watch.alarm = raise(
            AlarmKind::data, "", has_port ? port : "", AlarmLevel::error, estimate.time, estimate.time,
            status == ChannelStatus::missing
                ? fmt::format("{}: no number comes from this channel; check the cable and the converter", channel.name)
                : fmt::format("{}: outside {:g}..{:g} {}; check transducer and scaling", channel.name, channel.minimum,
                              channel.maximum, channel.unit));
      }
      watch.last_bad = estimate.time;
    } else if (watch.alarm >= 0 && estimate.time - watch.last_bad > options_.data_hold_s) {
      end(watch.alarm, watch.last_bad);
    }
    if (watch.alarm >= 0) report_.alarms[static_cast<std::size_t>(watch.alarm)].until = estimate.time;
  }
}

void AlarmStage::advance(double now) {
  if (!running_ || stale_ >= 0 || now - last_time_ <= stale_after_) return;
  const double since = last_time_ + stale_after_;
  stale_ = raise(AlarmKind::data, "", "", AlarmLevel::stale, since, since,
                 fmt::format("no sample for more than {:g} s; check the driver and the DAQ", stale_after_));
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
    last_time_ = estimate.time;
  }
  advance(estimate.time);
  if (stale_ == static_cast<int>(report_.alarms.size()) - 1 && stale_ >= 0 &&
      estimate.time - last_time_ <= stale_after_) {
    // Told to advance too far: the sample was only on its way. Nothing was silent, so nothing is left of it.
    report_.alarms.pop_back();
    stale_ = -1;
    ++changes_;
  }
  end(stale_, estimate.time);
  last_time_ = estimate.time;
  report_.time = estimate.time;
  check_data(estimate);
  detect(estimates);
  isolate(estimates);
  hand_over();
  tell_detections(estimate.time);
  tell_findings(estimate.time);
}

void AlarmStage::detect(const Estimate* estimates) {
  model_fits_ = true;
  for (std::size_t c = 0; c < doubted_.size(); ++c) doubted_[c] = channels_[c].alarm >= 0;
  const auto doubt = [this](const Watched& w) {
    for (const std::size_t channel : w.doubts) doubted_[channel] = true;
  };
  for (Watched& w : watched_) {
    w.detector->process(estimates[w.stage], w.detection);
    watch_blindness(w, estimates[0].time);
    if (w.withholds && w.detection.active) model_fits_ = false;
    if (w.detection.active && w.finding.kind == AlarmKind::sensor) doubt(w);
  }
  for (Watched& w : watched_) {
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
  for (Isolated& i : isolated_) i.isolator->process(estimates[i.stage], doubted_, i.finding);
  // The model is then known well enough: the cause explains what it did not.
  if (std::any_of(isolated_.begin(), isolated_.end(), [](const Isolated& i) { return i.names_the_cause(); }))
    model_fits_ = true;
}

void AlarmStage::tell_detections(double time) {
  for (Watched& w : watched_) {
    w.claim.raised = w.alarm >= 0;
    w.claim.model_fits = model_fits_;
    if (w.stands) {
      w.claim.explained = explained(w);
      w.claim.judgement_awaited = judgement_awaited(w);
      w.claim.told_by_another = told_by_isolator(w);
    }
    w.reason = reason_of(w.claim);
    if (w.reason != Reason::told) {
      end(w.alarm, time);
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
    tell(w, f, time);
  }
}

void AlarmStage::tell_findings(double time) {
  for (Isolated& i : isolated_) {
    Watched* w = i.names_the_cause() ? detected(i.finding) : nullptr;
    i.claim = Claim();
    i.claim.kind = i.finding.kind;
    i.claim.holds = i.finding.active;
    i.claim.raised = i.alarm >= 0;
    i.claim.told_by_another = w && w->alarm >= 0;
    i.claim.model_fits = model_fits_;
    i.reason = reason_of(i.claim);
    if (!w) {
      i.told_for = -1;
      if (i.reason == Reason::told)
        tell(i, i.finding, time);
      else
        end(i.alarm, time);
      continue;
    }
    // By the detector's name: of what explains it equally well, that is what the rig is watched for.
    Finding f = i.finding;
    const std::string own = named(f.effect, f.port);
    f.equivalent.erase(std::remove(f.equivalent.begin(), f.equivalent.end(), w->named), f.equivalent.end());
    if (own != w->named) f.equivalent.insert(f.equivalent.begin(), own);
    if (i.reason == Reason::told_by_another) {
      w->finding.equivalent = report_.alarms[static_cast<std::size_t>(w->alarm)].equivalent = f.equivalent;
      continue;
    }
    i.told_for = static_cast<int>(w - watched_.data());
    if (i.reason != Reason::told) continue;
    f.effect = w->finding.effect;
    f.port = w->finding.port;
    f.text = w->finding.text;
    f.confidence = w->detection.confidence;
    f.size_name = w->detector->size_name();
    f.size_unit = w->detector->size_unit();
    // The isolator's size, in the detector's words, where it weighed that very effect.
    f.none = 0;
    if (own == w->named && f.has_size && w->detection.per_effect > 0) {
      f.size *= w->detection.per_effect;
      f.low *= w->detection.per_effect;
      f.high *= w->detection.per_effect;
    } else {
      f.has_size = w->detection.has_size;
      f.size = w->detection.size;
      f.low = w->detection.low;
      f.high = w->detection.high;
    }
    tell(i, f, time);
  }
}

void AlarmStage::tell(Source& source, const Finding& f, double time) {
  const AlarmLevel level = f.kind == AlarmKind::unknown ? AlarmLevel::warning : AlarmLevel::error;
  if (source.alarm < 0) source.alarm = raise(f.kind, f.effect, f.port, level, f.since, time, f.text);
  const auto at = static_cast<std::size_t>(source.alarm);
  Alarm& alarm = report_.alarms[at];
  alarm.until = time;
  if (alarm.effect != f.effect || alarm.port != f.port || alarm.size_name != f.size_name) sizes_[at] = Size();
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
  keep_size(at, f.none);
}

void AlarmStage::watch_blindness(Watched& w, double time) {
  if (!w.detection.blind && w.unobserved < 0) return;
  if (w.unobserved < 0) {
    w.unobserved = static_cast<int>(report_.unobserved.size());
    report_.unobserved.push_back({w.name, w.finding.effect, w.finding.port, 0, false});
    w.watched_to = time;
  }
  Unobserved& unobserved = report_.unobserved[static_cast<std::size_t>(w.unobserved)];
  if (w.detection.blind) unobserved.seconds += time - w.watched_to;
  unobserved.now = w.detection.blind;
  w.watched_to = time;
}

bool AlarmStage::explained(const Watched& w) const {
  return std::any_of(isolated_.begin(), isolated_.end(), [&](const Isolated& i) {
    const Finding& f = i.finding;
    if (!i.names_the_cause() || f.kind == AlarmKind::unknown) return false;
    switch (w.finding.kind) {
      case AlarmKind::unknown:
        return true;
      case AlarmKind::sensor:
        return w.finding.effect.empty() && f.kind == AlarmKind::sensor;
      case AlarmKind::fault:
        return w.named != named(f.effect, f.port) && !among(f.equivalent, w.named);
      case AlarmKind::model:
      case AlarmKind::data:
        break;
    }
    return false;
  });
}

bool AlarmStage::judgement_awaited(const Watched& w) const {
  if (w.finding.kind == AlarmKind::sensor && !w.finding.effect.empty()) return false;
  return std::any_of(isolated_.begin(), isolated_.end(), [&](const Isolated& i) {
    return i.isolator->overrules() && i.isolator->judged_until() < w.detection.since;
  });
}

bool AlarmStage::told_by_isolator(const Watched& w) const {
  return std::any_of(isolated_.begin(), isolated_.end(), [&](const Isolated& i) {
    return i.alarm >= 0 && i.names_the_cause() && detected(i.finding) == &w;
  });
}

void AlarmStage::hand_over() {
  for (Isolated& i : isolated_) {
    if (i.alarm < 0 || i.finding.active || i.told_for < 0) continue;
    Watched& w = watched_[static_cast<std::size_t>(i.told_for)];
    if (!w.stands || w.alarm >= 0) continue;
    w.finding.equivalent = report_.alarms[static_cast<std::size_t>(i.alarm)].equivalent;
    w.finding.size_name = w.detector->size_name();
    w.finding.size_unit = w.detector->size_unit();
    w.alarm = i.alarm;
    i.alarm = i.told_for = -1;
  }
}

const AlarmStage::Watched* AlarmStage::detected(const Finding& finding) const {
  for (const Watched& w : watched_)
    if (w.stands && w.finding.kind == AlarmKind::fault && !w.finding.effect.empty() &&
        (w.named == named(finding.effect, finding.port) || among(finding.equivalent, w.named)))
      return &w;
  return nullptr;
}

AlarmStage::Watched* AlarmStage::detected(const Finding& finding) {
  return const_cast<Watched*>(static_cast<const AlarmStage*>(this)->detected(finding));
}

const AlarmReport& AlarmStage::report() const {
  report_.verdict = verdict();
  report_.withheld.clear();
  const auto add = [this](const Source& s, double since) {
    if (s.reason != Reason::told && s.reason != Reason::absent)
      report_.withheld.push_back({s.name, s.claim.kind, s.finding.effect, s.finding.port, since, s.reason});
  };
  for (const Watched& w : watched_) add(w, w.detection.since);
  for (const Isolated& i : isolated_) add(i, i.finding.since);
  return report_;
}

std::string AlarmStage::verdict() const {
  const Alarm* first = headline(report_);
  if (!first) return "No fault found.";
  if (!first->active) return "No fault now; there were alarms before.";
  const auto active =
      std::count_if(report_.alarms.begin(), report_.alarms.end(), [](const Alarm& alarm) { return alarm.active; });
  std::string text = first->text + size_text(*first) + ".";
  if (active > 1) text += fmt::format(" {} more alarm{}.", active - 1, active > 2 ? "s" : "");
  return text;
}

}  // namespace faultline
