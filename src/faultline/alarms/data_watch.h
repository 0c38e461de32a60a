// Alarms about the data themselves: a channel that is missing or out of range, and a rig that fell silent. Both are
// told at once, with the first bad sample or when the silence is long enough (alarm_options.h); setpoints and ground
// truth are not watched.
#pragma once

#include <string>
#include <vector>

#include "faultline/alarms/alarm_book.h"
#include "faultline/alarms/alarm_options.h"
#include "faultline/estimators/estimate.h"
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
  void check_channels(const Estimate& estimate, AlarmBook& book);
  bool is_bad(std::size_t channel) const { return channels_[channel].alarm >= 0; }

 private:
  struct Watched {
    std::string name, port, out_of_range;  // what is told then
    bool watched = true;
    int alarm = -1;  // of the book, while active
    double last_bad = 0;
  };
  std::vector<Watched> channels_;
  double hold_, stale_after_;  // s
  int stale_ = -1;
};

}  // namespace faultline
