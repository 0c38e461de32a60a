// Alarms about the data themselves, of every rig by its datasheet's channels alone: a channel that is missing or out
// of range, one whose readings are not like its transducer's (estimators/channel_watch.h), all of them held, and a rig
// that fell silent. Told with the first bad sample or when the silence is long enough (alarm_options.h); setpoints and
// ground truth are not watched. What a detector of the rig already tells is not told twice.
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
  bool is_bad(std::size_t channel) const { return channels_[channel].bad; }
  // Whether any channel is, and since when [s].
  bool any_bad() const { return any_bad_; }
  double bad_since() const { return bad_since_; }
  // Whether the numbers are held, or in another unit.
  bool unusable() const { return unusable_; }
  // Whether this very trouble of a transducer is told here, or that it gives no reading at all.
  bool tells(const std::string& effect, const std::string& port, const AlarmBook& book) const;

 private:
  struct Watched {
    std::string name, port, out_of_range;  // what is told then
    bool watched = true, noisy = false;    // noisy: its noise is declared
    ChannelStatus told = ChannelStatus::good;
    bool bad = false;
    int alarm = -1;  // of the book, while active; -1 too while another stage tells it
    double last_bad = 0, since = 0;
  };
  void tell(Watched& w, ChannelStatus status, double time, AlarmBook& book);
  bool all_held(const Estimate& estimate) const;

  std::vector<Watched> channels_;
  double hold_, stale_after_;  // s
  int stale_ = -1, held_ = -1;
  double last_held_ = 0;
  bool any_bad_ = false, unusable_ = false;
  double bad_since_ = 0;
};

}  // namespace faultline
