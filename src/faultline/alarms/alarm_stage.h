// From estimates to alarms: runs the rig's detectors, watches the data itself, keeps the life cycle of every alarm and says the
// verdict. The nodes and the offline program call this same code in the same order.
//
// Data alarms: a channel that is missing or out of range (ends a second after the last such sample); a rig that fell silent
// (stale: from the last sample plus `stale_after`). While the model does not fit (a detection of kind unknown), fault detections
// are withheld: they rest on that model. While the data are bad, faults already raised stay as they are.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "faultline/alarms/alarm.h"
#include "faultline/detectors/detector.h"

namespace faultline {

class AlarmStage {
 public:
  explicit AlarmStage(const Datasheet& sheet);

  void process(const Estimate& estimate);
  // The time went on to `now` [s] without a sample; raises the stale alarm where it is due. If the next sample shows that there
  // was no such silence, the alarm is taken back, so that what is told never depends on how long a sample was on its way.
  void advance(double now);
  void reset();

  // With the verdict as of the last sample.
  const AlarmReport& report() const {
    report_.verdict = verdict();
    return report_;
  }
  // Counts up whenever an alarm is raised, ends, or changes level: what must be published at once.
  std::uint64_t changes() const { return changes_; }

 private:
  struct Watched {
    std::string name, kind, effect, port, text;
    std::unique_ptr<Detector> detector;
    Detection detection;
    int alarm = -1;  // index into report_.alarms while active
  };
  struct ChannelWatch {
    int alarm = -1;
    double last_bad = 0;
  };
  int raise(const std::string& kind, const std::string& effect, const std::string& port, AlarmLevel level, double since,
            double raised, const std::string& text);
  void end(int& alarm, double time);
  void check_data(const Estimate& estimate);
  std::string verdict() const;

  Datasheet sheet_;
  double stale_after_;
  std::vector<Watched> watched_;
  std::vector<ChannelWatch> channels_;
  int stale_ = -1, gap_ = -1;
  bool running_ = false;
  double last_time_ = 0, first_time_ = 0;
  std::uint64_t changes_ = 0;
  mutable AlarmReport report_;  // its sentence is only written when somebody reads it
};

}  // namespace faultline
