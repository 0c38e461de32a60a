// Alarms about the data themselves: a channel that is missing or out of range, and a rig that fell silent. Both are
// told at once, with the first bad sample or when the silence is long enough (alarm_options.h); setpoints and ground
// truth are not watched.
#pragma once

#include <string>
#include <vector>

#include "faultline/alarms/alarm_book.h"
#include "faultline/alarms/alarm_options.h"
#include "faultline/isolation/channel_watch.h"
#include "faultline/rig/datasheet.h"

namespace faultline {

class DataWatch {
 public:
  DataWatch(const Datasheet& sheet, const AlarmOptions& options);
  void reset();  // the book is cleared by its owner

  // No sample came until `now` [s], the last at `last`.
  void advance(double last, double now, AlarmBook& book);
  // One came at `time`: a silence ends. If there was none because it was only on its way, the alarm is taken back.
  void arrived(double last, double time, AlarmBook& book);
  void check_channels(double time, const std::vector<ChannelStatus>& status, AlarmBook& book);

 private:
  struct Watched {
    std::string name, port, out_of_range;  // what is told then
    int alarm = -1;                        // of the book, while active
  };
  std::vector<Watched> channels_;
  ChannelWatch bad_;
  double stale_after_;  // s
  int stale_ = -1;
};

}  // namespace faultline
