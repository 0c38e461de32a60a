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

constexpr std::array<Trouble, 5> kTroubles = {{
    {ChannelStatus::missing, AlarmKind::data, "",
     "no number comes from this channel; check the cable and the converter"},
    {ChannelStatus::frozen, AlarmKind::sensor, "stuck", "this transducer is stuck: it repeats its reading"},
    {ChannelStatus::noisy, AlarmKind::sensor, "noise", "this transducer is noisy"},
    {ChannelStatus::spiky, AlarmKind::sensor, "", "this transducer has spikes; check cable and connector"},
    {ChannelStatus::quiet, AlarmKind::data, "",
     "far less noise than this transducer has; check the unit of its numbers and its cable"},
}};

}  // namespace

DataWatch::DataWatch(const Datasheet& sheet, const AlarmOptions& options)
    : hold_(std::max(options.data_hold_s, options.data_hold_periods * sheet.sample_period)),
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
    w.watched = channel.role != Role::setpoint && !channel.ground_truth;
    w.noisy = w.watched && channel.role != Role::command && channel.noise_std > 0;
    channels_.push_back(std::move(w));
  }
}

void DataWatch::reset() {
  for (Watched& w : channels_) {
    w.alarm = -1;
    w.bad = false;
    w.told = ChannelStatus::good;
  }
  stale_ = held_ = -1;
  any_bad_ = unusable_ = false;
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

// Every transducer whose noise should show repeats its reading, or stands at an end of its range.
bool DataWatch::all_held(const Estimate& estimate) const {
  int frozen = 0;
  for (std::size_t c = 0; c < channels_.size() && c < estimate.channel_status.size(); ++c) {
    if (!channels_[c].noisy) continue;
    if (estimate.channel_status[c] == ChannelStatus::frozen)
      ++frozen;
    else if (estimate.channel_status[c] != ChannelStatus::at_end)
      return false;
  }
  return frozen > 1;
}

void DataWatch::tell(Watched& w, ChannelStatus status, double time, AlarmBook& book) {
  if (w.told == status) return;
  book.end(w.alarm, time);
  w.told = status;
  if (!w.bad) w.since = time;
  w.bad = true;
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
  w.alarm = book.raise(t->kind, effect, w.port, AlarmLevel::error, time, time, w.name + ": " + t->text);
  book.at(w.alarm).confidence = 1;
}

void DataWatch::check_channels(const Estimate& estimate, AlarmBook& book) {
  const bool held = all_held(estimate);
  if (held) {
    if (held_ < 0) {
      held_ = book.raise(AlarmKind::data, "", "", AlarmLevel::error, estimate.time, estimate.time,
                         "All transducers repeat their readings: samples of a slower rate that are held, or a source "
                         "that stands still");
      book.at(held_).confidence = 1;
    }
    last_held_ = estimate.time;
  } else if (held_ >= 0 && estimate.time - last_held_ > hold_) {
    book.end(held_, last_held_);
  }
  if (held_ >= 0) book.at(held_).until = estimate.time;
  any_bad_ = unusable_ = held_ >= 0;
  bad_since_ = any_bad_ ? book.at(held_).since : estimate.time;
  for (std::size_t c = 0; c < channels_.size() && c < estimate.channel_status.size(); ++c) {
    Watched& w = channels_[c];
    if (!w.watched) continue;
    const ChannelStatus status = estimate.channel_status[c];
    if (status != ChannelStatus::good && status != ChannelStatus::at_end) {
      if (status != ChannelStatus::frozen || held_ < 0) tell(w, status, estimate.time, book);
      w.last_bad = estimate.time;
    } else if (w.bad && estimate.time - w.last_bad > hold_) {
      book.end(w.alarm, w.last_bad);
      w.bad = false;
      w.told = ChannelStatus::good;
    }
    if (w.alarm >= 0) book.at(w.alarm).until = estimate.time;
    if (!w.bad) continue;
    any_bad_ = true;
    unusable_ = unusable_ || w.told == ChannelStatus::quiet;
    bad_since_ = std::min(bad_since_, w.since);
  }
}

void DataWatch::advance(double last, double now, AlarmBook& book) {
  if (stale_ >= 0 || now - last <= stale_after_) return;
  const double since = last + stale_after_;
  stale_ = book.raise(AlarmKind::data, "", "", AlarmLevel::stale, since, since,
                      fmt::format("no sample for more than {:g} s; check the driver and the DAQ", stale_after_));
}

void DataWatch::arrived(double last, double time, AlarmBook& book) {
  advance(last, time, book);
  if (time - last > stale_after_ || !book.take_back(stale_)) book.end(stale_, time);
}

}  // namespace faultline
