// From estimates to alarms: runs the rig's detectors and isolators, watches the data itself, keeps the life cycle of
// every alarm and says the verdict. The nodes and the offline program call this same code in the same order.
//
// A detector or isolator reads the estimates of one of the rig's estimators: `stage`, by default the first. A detector
// whose `withholds_faults` is no (a redline) says unknown without speaking against the model. Sensors that a detector
// or the data already found off are named to the isolators, which leave them out; so are the channels that a detector
// of a fault lists in `doubts`, with commas between; where one of those is itself off, that fault is not raised. An
// isolator's alarm changes its place and size as it learns. An isolator that overrules weighed every fault of the
// datasheet: while it names one, detections of faults, of sensors without an effect and of unknown trouble that it does
// not confirm are not told; a detected fault waits for its judgement. What both found is one alarm, by the detector's
// effect and size; what two isolators name is one alarm too. reason.h has these rules as a table.
//
// Data alarms: a channel that is missing or out of range (ends a while after the last such sample); a rig that fell
// silent (stale: from the last sample plus a while; alarm_options.h has both). While the model does not fit (a
// detection of kind unknown), faults are withheld unless their isolator does without that model. While the data are
// bad, faults already raised stay as they are.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "faultline/alarms/alarm_book.h"
#include "faultline/alarms/alarm_options.h"
#include "faultline/alarms/data_watch.h"
#include "faultline/detectors/detector.h"
#include "faultline/isolation/isolator.h"
#include "faultline/rig/reference.h"

namespace faultline {

class AlarmStage {
 public:
  explicit AlarmStage(const Datasheet& sheet, const AlarmOptions& options = {});

  // What all estimators say about one sample, in the datasheet's order.
  void process(const std::vector<Estimate>& estimates);
  void process(const Estimate& estimate);  // of a rig with one estimator
  // The time went on to `now` [s] without a sample; raises the stale alarm where it is due. If the next sample shows
  // that there was no such silence, the alarm is taken back, so that what is told never depends on how long a sample
  // was on its way.
  void advance(double now);
  void reset();

  // With the verdict and what is withheld as of the last sample.
  const AlarmReport& report() const;
  // Counts up whenever an alarm is raised, ends, or changes level: what must be published at once.
  std::uint64_t changes() const { return book_.changes(); }

  // What its detectors and isolators have learnt of the healthy rig so far.
  References references() const;
  // Before the first sample: they judge by this at once instead of learning. reset() does not forget it. Those of
  // estimators are for others. InputError, which names the stage, where a reference fits none of them.
  void restore(const References& references);

 private:
  // A detector or an isolator with what it says now and what became of it.
  struct Source {
    std::string name;       // in the datasheet
    std::size_t stage = 0;  // whose estimates it reads
    Finding finding;        // of a detector: its detection in the datasheet's words
    Claim claim;
    Reason reason = Reason::absent;
    int alarm = -1;  // of the book, while active
  };
  struct Watched : Source {
    std::unique_ptr<Detector> detector;
    Detection detection;
    std::string named;  // effect@port
    bool withholds = true;
    bool stands = false;              // as far as is known without the isolators
    std::vector<std::size_t> doubts;  // channels that isolators leave out while it stands
    int unobserved = -1;              // of the report
    double watched_to = 0;
    bool claims_nothing() const { return !detection.active && alarm < 0; }
  };
  struct Isolated : Source {
    std::unique_ptr<Isolator> isolator;
    int told_for = -1;  // the detector that found the same, while this alarm tells it
    // The finding in that detector's words, and what it was made of: words are made anew only where they change.
    Finding shown, shown_of;
    int shown_for = -1;
    bool on_bad_data = false;
    // Names a cause, having weighed every other.
    bool names_the_cause() const { return isolator->overrules() && finding.active && !on_bad_data; }
  };
  void process(const Estimate* estimates);
  void detect(const Estimate* estimates);
  void isolate(const Estimate* estimates);
  void tell_detections(double time);
  void tell_findings(double time);
  void hand_over();  // alarms to the detectors that still find what an isolator no longer does
  void watch_blindness(Watched& w, double time);
  bool explained(const Watched& w) const;
  bool judgement_awaited(const Watched& w) const;
  bool told_by_isolator(const Watched& w) const;
  // Whether another isolator's alarm already names the same cause.
  bool told_by_another(const Isolated& i) const;
  // The detector that found what the finding names, or what cannot be told from it; null: none did.
  Watched* detected(const Finding& finding);
  const Watched* detected(const Finding& finding) const;
  std::string verdict() const;

  Datasheet sheet_;
  std::vector<Watched> watched_;
  std::vector<Isolated> isolated_;
  std::vector<bool> doubted_;  // one per channel: its transducer is known to be off
  DataWatch data_;
  bool model_fits_ = true;
  bool running_ = false;
  double begin_ = 0, last_time_ = 0;  // s
  mutable AlarmBook book_;  // the report's verdict and what is withheld are only written when somebody reads it
};

}  // namespace faultline
