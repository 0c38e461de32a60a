#include "faultline/alarms/data_watch.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>

namespace faultline {
namespace {

struct Trouble {
  ChannelStatus status;
  AlarmKind kind;
  const char* effect;  // that it is at a sensor port; empty: none
  const char* text;
};

// Samples with the stamp of the one before, more than a source repeats one, from which stamps tell no time.
constexpr int kStandsStill = 3;
constexpr std::size_t kMostStretches = 1000;  // while nothing is judged

constexpr std::array<Trouble, 6> kTroubles = {{
    {ChannelStatus::missing, AlarmKind::data, "",
     "no number comes from this channel; check the cable and the converter"},
    {ChannelStatus::frozen, AlarmKind::sensor, "stuck", "this transducer is stuck: it repeats its reading"},
    {ChannelStatus::noisy, AlarmKind::sensor, "noise", "this transducer is noisy"},
    {ChannelStatus::spiky, AlarmKind::sensor, "", "this transducer has spikes; check cable and connector"},
    {ChannelStatus::quiet, AlarmKind::data, "",
     "far less noise than this transducer has; check the unit of its numbers and its cable"},
    {ChannelStatus::at_end, AlarmKind::data, "",
     "nothing but an end of its range; check its cable and supply, or whether it can show what there is"},
}};

}  // namespace

DataWatch::DataWatch(const Datasheet& sheet, const AlarmOptions& options)
    : bad_(sheet),
      stale_after_(std::max(options.shortest_stale_s,
                            std::min(options.stale_periods * sheet.sample_period,
                                     options.few_stale_periods * sheet.sample_period + options.person_stale_s))) {
  for (const Channel& channel : sheet.channels) {
    Watched w;
    w.name = channel.name;
    const std::string port = "sensor." + channel.name;
    if (std::any_of(sheet.ports.begin(), sheet.ports.end(), [&](const Port& p) { return p.name == port; }))
      w.port = port;
    w.out_of_range = fmt::format("{}: outside {:g}..{:g} {}; check transducer and scaling", channel.name,
                                 channel.minimum, channel.maximum, channel.unit);
    channels_.push_back(std::move(w));
  }
}

void DataWatch::reset() {
  for (Watched& w : channels_) {
    w.alarm = -1;
    w.told = ChannelStatus::good;
  }
  bad_.reset();
  stale_ = held_ = -1;
}

bool DataWatch::tells(const std::string& effect, const std::string& port, const AlarmBook& book) const {
  return !effect.empty() && std::any_of(channels_.begin(), channels_.end(), [&](const Watched& w) {
    if (w.alarm < 0) return false;
    // What repeats then is the last good reading.
    if (w.told == ChannelStatus::missing || w.told == ChannelStatus::out_of_range) return w.port == port;
    const Alarm& alarm = book.report.alarms[static_cast<std::size_t>(w.alarm)];
    return alarm.effect == effect && alarm.port == port;
  });
}

void DataWatch::tell(Watched& w, ChannelStatus status, double time, AlarmBook& book) const {
  if (w.told == status) return;
  book.end(w.alarm, time);
  w.told = status;
  if (status == ChannelStatus::out_of_range) {
    w.alarm = book.raise(AlarmKind::data, "", w.port, AlarmLevel::error, time, time, w.out_of_range);
    return;
  }
  const auto* t =
      std::find_if(kTroubles.begin(), kTroubles.end(), [&](const Trouble& x) { return x.status == status; });
  const std::string effect = w.port.empty() ? "" : t->effect;
  const bool told_already =
      !effect.empty() && std::any_of(book.report.alarms.begin(), book.report.alarms.end(), [&](const Alarm& a) {
        return a.active && a.effect == effect && a.port == w.port;
      });
  if (told_already) return;
  // A rig may well be where its transducer ends: a tank that is full.
  const AlarmLevel level = status == ChannelStatus::at_end ? AlarmLevel::warning : AlarmLevel::error;
  w.alarm = book.raise(t->kind, effect, w.port, level, time, time, w.name + ": " + t->text);
  book.at(w.alarm).confidence = 1;
}

void DataWatch::check_channels(double time, const std::vector<ChannelStatus>& status, AlarmBook& book) {
  bad_.process(time, status);
  if (!bad_.held()) {
    book.end(held_, bad_.last_held());
  } else if (held_ < 0) {
    held_ = book.raise(AlarmKind::data, "", "", AlarmLevel::error, time, time,
                       "All transducers repeat their readings: samples of a slower rate that are held, or a source "
                       "that stands still");
    book.at(held_).confidence = 1;
  }
  if (held_ >= 0) book.at(held_).until = time;
  for (std::size_t c = 0; c < channels_.size(); ++c) {
    Watched& w = channels_[c];
    if (bad_.is_bad(c)) {
      tell(w, bad_.trouble(c), time, book);
    } else {
      book.end(w.alarm, bad_.last_bad(c));
      w.told = ChannelStatus::good;
    }
    if (w.alarm >= 0) book.at(w.alarm).until = time;
  }
}

void DataWatch::advance(double last, double now, AlarmBook& book) {
  if (stale_ >= 0 || now - last <= stale_after_) return;
  const double since = last + stale_after_;
  stale_ = book.raise(AlarmKind::data, "", "", AlarmLevel::stale, since, since,
                      fmt::format("no sample for more than {:g} s; check the driver and the DAQ", stale_after_));
}

void DataWatch::heard(double time) {
  if (!heard_.empty() && time < heard_.back().to - stale_after_) heard_.clear();  // a run that begins anew
  if (heard_.empty()) {
    heard_.push_back({time, time});
    still_ = 0;
    return;
  }
  Stretch& latest = heard_.back();
  if (time == latest.to) ++still_;
  if (time <= latest.to) return;
  // After stamps that stood still (zeros from a source without a clock) a step is no silence: samples came.
  if (time - latest.to <= stale_after_ || still_ >= kStandsStill)
    latest.to = time;
  else
    heard_.push_back({time, time});
  still_ = 0;
  if (heard_.size() > kMostStretches) heard_.pop_front();
}

double DataWatch::latest(double judged) const {
  if (heard_.empty()) return judged;
  // Whoever judges hears samples on a path of its own: the very last may have come there only.
  const double heard = heard_.back().to;
  return judged > heard && judged - heard <= stale_after_ ? judged : heard;
}

bool DataWatch::is_ahead_of(double time, const AlarmBook& book) const {
  return stale_ >= 0 && !heard_.empty() && time <= heard_.back().to &&
         book.report.alarms[static_cast<std::size_t>(stale_)].since == heard_.back().to + stale_after_;
}

void DataWatch::arrived(double last, double time, AlarmBook& book) {
  const auto came = [&](double at) {
    advance(last, at, book);
    if (is_ahead_of(at, book)) return;
    if (at - last > stale_after_ || !book.take_back(stale_)) book.end(stale_, at);
    last = at;
  };
  for (const Stretch& stretch : heard_) {
    if (stretch.from >= time) break;
    if (stretch.from > last) came(stretch.from);
    last = std::max(last, std::min(stretch.to, time));
  }
  came(time);
  while (heard_.size() > 1 && heard_.front().to < time) heard_.pop_front();
}

}  // namespace faultline
