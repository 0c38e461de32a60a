#include "faultline/alarms/data_watch.h"

#include <algorithm>

#include <fmt/format.h>

namespace faultline {

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
  for (Watched& w : channels_) w.alarm = -1;
  bad_.reset();
  stale_ = -1;
}

void DataWatch::check_channels(double time, const std::vector<ChannelStatus>& status, AlarmBook& book) {
  bad_.process(time, status);
  for (std::size_t c = 0; c < channels_.size() && c < status.size(); ++c) {
    Watched& w = channels_[c];
    if (!bad_.is_bad(c))
      book.end(w.alarm, bad_.last_bad(c));
    else if (w.alarm < 0)
      w.alarm = book.raise(
          AlarmKind::data, "", w.port, AlarmLevel::error, time, time,
          status[c] == ChannelStatus::missing
              ? fmt::format("{}: no number comes from this channel; check the cable and the converter", w.name)
              : w.out_of_range);
    if (w.alarm >= 0) book.at(w.alarm).until = time;
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
