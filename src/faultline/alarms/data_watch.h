// Alarms about the data themselves, of every rig by its datasheet's channels alone: a channel that is missing or out
// of range, one whose readings are not like its transducer's (estimators/channel_watch.h), all of them held, and a rig
// that fell silent. Told with the first bad sample or when the silence is long enough (alarm_options.h); setpoints and
// ground truth are not watched. What a detector of the rig already tells is not told twice.
#pragma once

#include <deque>
#include <string>
#include <vector>

#include "faultline/alarms/alarm_book.h"
#include "faultline/alarms/alarm_options.h"
#include "faultline/isolation/bad_channels.h"
#include "faultline/rig/datasheet.h"

namespace faultline {

class DataWatch {
 public:
  DataWatch(const Datasheet& sheet, const AlarmOptions& options);
  void reset();  // the book is cleared by its owner

  // A sample came, be it judged or not; live only, where judgements may pause while samples go on. Where it is never
  // called, what is judged is what came.
  void heard(double time);
  bool any_heard() const { return !heard_.empty(); }
  // Time of the last sample, be it judged or not, where the last that is judged is of `judged`.
  double latest(double judged) const;
  // No sample came until `now` [s], the last at `last`.
  void advance(double last, double now, AlarmBook& book);
  // One is judged at `time`: a silence ends. If there was none because it was only on its way, the alarm is taken back.
  // A judgement of a sample that came before the silence does nothing to it.
  void arrived(double last, double time, AlarmBook& book);
  void check_channels(double time, const std::vector<ChannelStatus>& status, AlarmBook& book);
  // Whether this very trouble of a transducer is told here, or that it gives no reading at all.
  bool tells(const std::string& effect, const std::string& port, const AlarmBook& book) const;

 private:
  struct Watched {
    std::string name, port, out_of_range;  // what is told then
    ChannelStatus told = ChannelStatus::good;
    int alarm = -1;  // of the book, while active; -1 too while another stage tells it
  };
  // In which samples came without a silence.
  struct Stretch {
    double from, to;
  };
  void tell(Watched& w, ChannelStatus status, double time, AlarmBook& book) const;
  bool is_ahead_of(double time, const AlarmBook& book) const;  // a silence that is told

  std::vector<Watched> channels_;
  std::deque<Stretch> heard_;  // that are not judged to their end, and the latest
  int still_ = 0;              // samples in a row whose stamp was that of the one before
  BadChannels bad_;
  double stale_after_;  // s
  int stale_ = -1, held_ = -1;
};

}  // namespace faultline
