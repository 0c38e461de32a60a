// From estimates to alarms: runs the rig's detectors and isolators, watches the data itself, keeps the life cycle of every alarm and
// says the verdict. The nodes and the offline program call this same code in the same order.
//
// A detector or isolator reads the estimates of one of the rig's estimators: `stage`, by default the first. A detector whose
// `withholds_faults` is no (a redline) says unknown without speaking against the model. Sensors that a detector or the data
// already found off are named to the isolators, which leave them out; so are the channels that a detector of a fault lists in `doubts`,
// with commas between; where one of those is itself off, that fault is not raised. An isolator's alarm changes its place and size as it learns.
// An isolator that overrules weighed every fault of the datasheet: while it names one, detections of faults, of sensors without an
// effect and of unknown trouble that it does not confirm are not told; a detected fault waits for its judgement. What both found is one
// alarm, by the detector's effect and size.
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
#include "faultline/isolation/isolator.h"

namespace faultline {

class AlarmStage {
 public:
  explicit AlarmStage(const Datasheet& sheet);

  // What all estimators say about one sample, in the datasheet's order.
  void process(const std::vector<Estimate>& estimates);
  void process(const Estimate& estimate);  // of a rig with one estimator
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
    std::size_t stage = 0;  // whose estimates it reads
    bool withholds = true;
    std::vector<std::size_t> doubts;  // channels that isolators leave out while it is active
    std::unique_ptr<Detector> detector;
    Detection detection;
    int alarm = -1;       // index into report_.alarms while active
    int unobserved = -1;  // index into report_.unobserved
    double watched_to = 0;
  };
  struct Isolated {
    std::size_t stage = 0;
    std::unique_ptr<Isolator> isolator;
    Finding finding;
    int alarm = -1;
    int told_for = -1;  // the detector that found the same, while this alarm tells it
  };
  struct ChannelWatch {
    int alarm = -1;
    double last_bad = 0;
  };
  int raise(const std::string& kind, const std::string& effect, const std::string& port, AlarmLevel level, double since,
            double raised, const std::string& text);
  void end(int& alarm, double time);
  void check_data(const Estimate& estimate);
  void process(const Estimate* estimates);
  void detect(const Estimate* estimates);
  void isolate(const Estimate* estimates);
  void hand_over();  // alarms to the detectors that still find what an isolator no longer does
  void tell_findings(double time, bool model_fits);
  void watch_blindness(Watched& w, double time);
  bool explained(const Watched& w) const;  // by an isolator that overrules
  bool awaited(const Watched& w) const;    // its judgement of when the detection began
  bool told(const Watched& w) const;       // by an isolator's alarm
  // The detector that found what the finding names, or what cannot be told from it; null: none did.
  const Watched* detected(const Finding& finding) const;
  std::string verdict() const;

  Datasheet sheet_;
  double stale_after_;
  std::size_t clock_ = 0;  // the first estimator that speaks at every sample: its time and channels are the data's
  std::vector<Watched> watched_;
  std::vector<Isolated> isolated_;
  std::vector<bool> doubted_;  // one per channel: its transducer is known to be off
  std::vector<ChannelWatch> channels_;
  int stale_ = -1, gap_ = -1;
  bool running_ = false;
  double last_time_ = 0, first_time_ = 0;
  std::uint64_t changes_ = 0;
  mutable AlarmReport report_;  // its sentence is only written when somebody reads it
};

}  // namespace faultline
