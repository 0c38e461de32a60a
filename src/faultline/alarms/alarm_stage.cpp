#include "faultline/alarms/alarm_stage.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kDataHold = 1.0;          // s, for which a data alarm outlives the last bad sample
constexpr double kStalePeriods = 100;      // silence of this many sample periods is stale ...
constexpr double kShortestStale = 0.1;     // s, ... but never less than this
constexpr std::size_t kMostAlarms = 1000;  // kept; the oldest ended ones go first

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

}  // namespace

AlarmLevel worst(const AlarmReport& report) {
  AlarmLevel level = AlarmLevel::ok;
  for (const Alarm& alarm : report.alarms)
    if (alarm.active) level = std::max(level, alarm.level);
  return level;
}

AlarmStage::AlarmStage(const Datasheet& sheet)
    : sheet_(sheet), stale_after_(std::max(kShortestStale, kStalePeriods * sheet.sample_period)) {
  for (const StageSpec& spec : sheet_.detectors) {
    Watched w;
    w.name = spec.name;
    w.kind = spec.settings.word("kind");
    w.effect = spec.settings.word_or("effect", "");
    w.port = spec.settings.word_or("port", "");
    w.text = spec.settings.word("text");
    w.stage = stage_of(sheet_, spec);
    w.withholds = w.kind == "unknown" && yes_or_no(spec, "withholds_faults", true);
    if (w.kind == "sensor")
      for (const Port& port : sheet_.ports)
        if (port.name == w.port && port.kind == PortKind::sensor)
          w.doubts.push_back(static_cast<std::size_t>(sheet_.channel(port.channel)));
    for (const std::string& channel : split(spec.settings.word_or("doubts", "")))
      w.doubts.push_back(static_cast<std::size_t>(sheet_.channel(channel)));
    w.detector = make_detector(sheet_, spec);
    spec.settings.check_used();
    watched_.push_back(std::move(w));
  }
  for (const StageSpec& spec : sheet_.isolators) {
    Isolated isolated;
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
    w.alarm = w.unobserved = -1;
  }
  for (Isolated& i : isolated_) {
    i.isolator->reset();
    i.finding = Finding();
    i.alarm = i.told_for = -1;
  }
  std::fill(channels_.begin(), channels_.end(), ChannelWatch());
  stale_ = gap_ = -1;
  running_ = false;
  report_.alarms.clear();
  report_.unobserved.clear();
  ++changes_;
}

int AlarmStage::raise(const std::string& kind, const std::string& effect, const std::string& port, AlarmLevel level,
                      double since, double raised, const std::string& text) {
  if (report_.alarms.size() >= kMostAlarms) {
    // Indices of active alarms must stay valid, so the oldest ended alarm is reused.
    for (std::size_t i = 0; i < report_.alarms.size(); ++i)
      if (!report_.alarms[i].active) {
        report_.alarms[i] = Alarm();
        report_.alarms[i].kind = kind;
        report_.alarms[i].effect = effect;
        report_.alarms[i].port = port;
        report_.alarms[i].level = level;
        report_.alarms[i].since = since;
        report_.alarms[i].raised = raised;
        report_.alarms[i].until = since;
        report_.alarms[i].active = true;
        report_.alarms[i].text = text;
        ++changes_;
        return static_cast<int>(i);
      }
  }
  Alarm alarm;
  alarm.kind = kind;
  alarm.effect = effect;
  alarm.port = port;
  alarm.level = level;
  alarm.since = alarm.until = since;
  alarm.raised = raised;
  alarm.active = true;
  alarm.text = text;
  report_.alarms.push_back(alarm);
  ++changes_;
  return static_cast<int>(report_.alarms.size()) - 1;
}

void AlarmStage::end(int& alarm, double time) {
  if (alarm < 0) return;
  Alarm& a = report_.alarms[static_cast<std::size_t>(alarm)];
  a.active = false;
  a.until = time;
  alarm = -1;
  ++changes_;
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
            "data", "", has_port ? port : "", AlarmLevel::error, estimate.time, estimate.time,
            status == ChannelStatus::missing
                ? fmt::format("{}: no number comes from this channel; check the cable and the converter", channel.name)
                : fmt::format("{}: outside {:g}..{:g} {}; check transducer and scaling", channel.name, channel.minimum,
                              channel.maximum, channel.unit));
      }
      watch.last_bad = estimate.time;
    } else if (watch.alarm >= 0 && estimate.time - watch.last_bad > kDataHold) {
      end(watch.alarm, watch.last_bad);
    }
    if (watch.alarm >= 0) report_.alarms[static_cast<std::size_t>(watch.alarm)].until = estimate.time;
  }
}

void AlarmStage::advance(double now) {
  if (!running_ || stale_ >= 0 || now - last_time_ <= stale_after_) return;
  const double since = last_time_ + stale_after_;
  stale_ = raise("data", "", "", AlarmLevel::stale, since, since,
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
    first_time_ = last_time_ = estimate.time;
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
}

void AlarmStage::detect(const Estimate* estimates) {
  const Estimate& estimate = estimates[0];
  bool model_fits = true;
  for (std::size_t c = 0; c < doubted_.size(); ++c) doubted_[c] = channels_[c].alarm >= 0;
  for (Watched& w : watched_) {
    w.detector->process(estimates[w.stage], w.detection);
    watch_blindness(w, estimate.time);
    if (w.withholds && w.detection.active) model_fits = false;
    if (w.detection.active && w.kind == "sensor")
      for (const std::size_t channel : w.doubts) doubted_[channel] = true;
  }
  // A fault that shows in a transducer which is itself off is none.
  for (Watched& w : watched_)
    if (w.detection.active && w.kind == "fault" && w.alarm < 0)
      for (const std::size_t channel : w.doubts)
        if (doubted_[channel]) w.detection.active = false;
  for (Watched& w : watched_)
    if (w.detection.active && w.kind == "fault")
      for (const std::size_t channel : w.doubts) doubted_[channel] = true;
  isolate(estimates);
  hand_over();
  for (const Isolated& i : isolated_)
    if (i.isolator->overrules() && i.finding.active) model_fits = true;
  for (Watched& w : watched_) {
    const bool wanted = w.detection.active && !explained(w) && !(w.alarm < 0 && (awaited(w) || told(w))) &&
                        (w.kind != "fault" || model_fits || w.alarm >= 0);
    if (wanted && w.alarm < 0)
      w.alarm = raise(w.kind, w.effect, w.port, w.kind == "unknown" ? AlarmLevel::warning : AlarmLevel::error,
                      w.detection.since, estimate.time, "");
    if (!wanted && w.alarm >= 0) end(w.alarm, estimate.time);
    if (w.alarm < 0) continue;
    Alarm& alarm = report_.alarms[static_cast<std::size_t>(w.alarm)];
    alarm.until = estimate.time;
    alarm.has_size = w.detection.has_size;
    alarm.size = w.detection.size;
    alarm.low = w.detection.low;
    alarm.high = w.detection.high;
    alarm.confidence = w.detection.confidence;
    if (alarm.size_name.empty()) {
      alarm.size_name = w.detector->size_name();
      alarm.size_unit = w.detector->size_unit();
      alarm.text = w.text;
    }
  }
  tell_findings(estimate.time, model_fits);
}

void AlarmStage::watch_blindness(Watched& w, double time) {
  if (!w.detection.blind && w.unobserved < 0) return;
  if (w.unobserved < 0) {
    w.unobserved = static_cast<int>(report_.unobserved.size());
    report_.unobserved.push_back({w.name, w.effect, w.port, 0, false});
    w.watched_to = time;
  }
  Unobserved& unobserved = report_.unobserved[static_cast<std::size_t>(w.unobserved)];
  if (w.detection.blind) unobserved.seconds += time - w.watched_to;
  unobserved.now = w.detection.blind;
  w.watched_to = time;
}

bool AlarmStage::explained(const Watched& w) const {
  for (const Isolated& i : isolated_) {
    const Finding& f = i.finding;
    if (!i.isolator->overrules() || !f.active || f.kind == "unknown") continue;
    if (w.kind == "unknown" || (w.kind == "sensor" && w.effect.empty() && f.kind == "sensor")) return true;
    if (w.kind != "fault") continue;
    const std::string name = w.effect + "@" + w.port;
    if (name != f.effect + "@" + f.port &&
        std::find(f.equivalent.begin(), f.equivalent.end(), name) == f.equivalent.end())
      return true;
  }
  return false;
}

bool AlarmStage::awaited(const Watched& w) const {
  if (w.kind == "sensor" && !w.effect.empty()) return false;
  return std::any_of(isolated_.begin(), isolated_.end(), [&](const Isolated& i) {
    return i.isolator->overrules() && i.isolator->judged_until() < w.detection.since;
  });
}

void AlarmStage::hand_over() {
  for (Isolated& i : isolated_) {
    if (i.alarm < 0 || i.finding.active || i.told_for < 0) continue;
    Watched& w = watched_[static_cast<std::size_t>(i.told_for)];
    if (!w.detection.active || w.alarm >= 0) continue;
    w.alarm = i.alarm;
    i.alarm = i.told_for = -1;
  }
}

bool AlarmStage::told(const Watched& w) const {
  return std::any_of(isolated_.begin(), isolated_.end(), [&](const Isolated& i) {
    return i.alarm >= 0 && i.finding.active && i.isolator->overrules() && detected(i.finding) == &w;
  });
}

const AlarmStage::Watched* AlarmStage::detected(const Finding& finding) const {
  for (const Watched& w : watched_) {
    if (!w.detection.active || w.kind != "fault" || w.effect.empty()) continue;
    const std::string name = w.effect + "@" + w.port;
    if (name == finding.effect + "@" + finding.port ||
        std::find(finding.equivalent.begin(), finding.equivalent.end(), name) != finding.equivalent.end())
      return &w;
  }
  return nullptr;
}

void AlarmStage::isolate(const Estimate* estimates) {
  for (Isolated& i : isolated_) i.isolator->process(estimates[i.stage], doubted_, i.finding);
}

void AlarmStage::tell_findings(double time, bool model_fits) {
  for (Isolated& i : isolated_) {
    Finding f = i.finding;
    const Watched* w = f.active && i.isolator->overrules() ? detected(f) : nullptr;
    const bool own_name = w && f.effect == w->effect && f.port == w->port;
    if (w) {
      // By the detector's name: of what explains it equally well, that is what the rig is watched for.
      const std::string own = f.effect + "@" + f.port, name = w->effect + "@" + w->port;
      f.equivalent.erase(std::remove(f.equivalent.begin(), f.equivalent.end(), name), f.equivalent.end());
      if (own != name) f.equivalent.insert(f.equivalent.begin(), own);
    }
    if (w && w->alarm >= 0 && i.alarm < 0) {
      report_.alarms[static_cast<std::size_t>(w->alarm)].equivalent = f.equivalent;
      continue;
    }
    i.told_for = w ? static_cast<int>(w - watched_.data()) : -1;
    const bool wanted = f.active && (model_fits || f.kind != "fault" || i.alarm >= 0);
    if (!wanted && i.alarm >= 0) end(i.alarm, time);
    if (!wanted) continue;
    if (w) {
      f.effect = w->effect;
      f.port = w->port;
      f.text = w->text;
      f.confidence = w->detection.confidence;
      f.size_name = w->detector->size_name();
      f.size_unit = w->detector->size_unit();
      // The isolator's size, in the detector's words, where it weighed that very effect.
      if (own_name && f.has_size && w->detection.per_effect > 0) {
        f.size *= w->detection.per_effect;
        f.low *= w->detection.per_effect;
        f.high *= w->detection.per_effect;
      } else {
        f.has_size = w->detection.has_size;
        f.size = w->detection.size;
        f.low = w->detection.low;
        f.high = w->detection.high;
      }
    }
    if (i.alarm < 0) i.alarm = raise(f.kind, f.effect, f.port, AlarmLevel::error, f.since, time, f.text);
    Alarm& alarm = report_.alarms[static_cast<std::size_t>(i.alarm)];
    alarm.until = time;
    if (alarm.effect != f.effect || alarm.port != f.port || alarm.kind != f.kind || alarm.text != f.text) {
      alarm.kind = f.kind;
      alarm.effect = f.effect;
      alarm.port = f.port;
      alarm.text = f.text;
      ++changes_;
    }
    alarm.level = f.kind == "unknown" ? AlarmLevel::warning : AlarmLevel::error;
    alarm.equivalent = f.equivalent;
    alarm.has_size = f.has_size;
    alarm.size_name = f.size_name;
    alarm.size_unit = f.size_unit;
    alarm.size = f.size;
    alarm.low = f.low;
    alarm.high = f.high;
    alarm.confidence = f.confidence;
  }
}

std::string AlarmStage::verdict() const {
  const Alarm* chosen = nullptr;
  int active = 0;
  for (const Alarm& alarm : report_.alarms) {
    if (!alarm.active) continue;
    ++active;
    if (!chosen || alarm.level > chosen->level) chosen = &alarm;
  }
  if (!chosen) return report_.alarms.empty() ? "No fault found." : "No fault now; there were alarms before.";
  std::string text = chosen->text + size_text(*chosen) + ".";
  if (active > 1) text += fmt::format(" {} more alarm{}.", active - 1, active > 2 ? "s" : "");
  return text;
}

}  // namespace faultline
