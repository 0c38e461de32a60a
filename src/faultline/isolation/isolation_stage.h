// Runs a rig's detectors and isolators over the estimates of its stages and decides which of their claims are told: the
// first half of the alarm stage; alarms/alarm_keeper.h is the other.
//
// A detector or isolator reads the estimates of one of the rig's estimators: `stage`, by default the first. A detector
// whose `withholds_faults` is no (a redline) says unknown without speaking against the model. Sensors that a detector
// or the data already found off are named to the isolators, which leave them out; so are the channels that a detector
// of a fault lists in `doubts`, with commas between; where one of those is itself off, that fault is not raised. An
// isolator that overrules weighed every fault of the datasheet: while it names one, detections of faults, of sensors
// without an effect and of unknown trouble that it does not confirm are not told; a detected fault waits for its
// judgement. What both found is one alarm; what two isolators name is one too. One that weighed every effect of the
// library has the say over one that knows the faults of a table. reason.h has these rules as a table.
//
// While the model does not fit (a detection of kind unknown), faults are withheld unless their isolator does without
// that model. While the data are bad, faults already raised stay as they are.
#pragma once

#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "faultline/isolation/assessment.h"
#include "faultline/isolation/bad_channels.h"
#include "faultline/rig/reference.h"

namespace faultline {

class IsolationStage {
 public:
  explicit IsolationStage(const Datasheet& sheet);

  // What all estimators say about one sample, in the datasheet's order. InputError where there are not as many. Begins
  // anew where time jumps back.
  const Assessment& process(const std::vector<Estimate>& estimates);
  const Assessment& process(const Estimate& estimate);  // of a rig with one estimator
  void reset();

  // What its detectors and isolators have learnt of the healthy rig so far.
  References references() const;
  // Before the first sample: they judge by this at once instead of learning. reset() does not forget it. Those of
  // estimators are for others. InputError, which names the stage, where a reference fits none of them.
  void restore(const References& references);

 private:
  struct Watched {  // what every sample asks comes first
    std::unique_ptr<Detector> detector;
    std::size_t stage = 0;  // whose estimates it reads
    Claim claim;
    bool of_transducer = false;  // and not of the rig
    bool of_output = false;      // about a channel that the rig's inputs move
    bool stands = false;         // as far as is known without the isolators
    bool raised = false;         // its alarm was told at the last sample
    bool withholds = true;
    double raised_at = 0;  // s
    Finding meaning;
    std::string named;                // effect@port
    std::vector<std::size_t> doubts;  // channels that isolators leave out while it stands
    int under = -1;                   // the detector under whose alarm this one's stands
  };
  struct Isolated {
    std::unique_ptr<Isolator> isolator;
    std::size_t stage = 0;
    bool raised = false;
    double raised_at = 0;  // s
    bool on_bad_data = false;
    int told_for = -1;  // the detector that found the same, while this one's alarm tells it
    double judged_until = std::numeric_limits<double>::quiet_NaN();  // s
    double interval = 0;                                             // s, the longest between two judgements
  };
  const Assessment& process(const Estimate* estimates);
  bool detect(const Estimate* estimates);  // whether any detector says something, or is blind
  void isolate(const Estimate* estimates);
  void hand_over();  // alarms to the detectors that still find what an isolator no longer does
  void decide_detections();
  void decide_findings();
  const Finding& finding(const Isolated& i) const { return isolator_result(i).finding; }
  const IsolatorResult& isolator_result(const Isolated& i) const;
  const Detection& detection(const Watched& w) const;
  // Names a cause, having weighed every other.
  bool names_the_cause(const Isolated& i) const {
    return i.isolator->overrules() && finding(i).active && !i.on_bad_data;
  }
  // A claim that rests on all channels and was not raised before one of them went bad.
  template <class Stage>
  bool raised_on_bad_data(const Stage& s) const {
    return !s.raised || s.raised_at >= channels_.bad_since();
  }
  bool explained(const Watched& w) const;
  bool judgement_awaited(const Watched& w) const;
  // Of one that knows a few causes, until those that weigh all have judged that time and do not suspect another cause;
  // not for ever, for they may be held up.
  bool judgement_awaited(const Isolated& i) const;
  bool told_by_isolator(std::size_t detector) const;
  bool follows(const Watched& w) const;  // from what another alarm tells
  // Whether another isolator's alarm already names the same cause.
  bool told_by_another(const Isolated& i) const;
  bool told_by_watch(const Isolated& i) const;
  // Whether an isolator that weighed every effect has another cause for what this one's table takes for one of its own.
  bool explained(const Isolated& i) const;
  // The detector that found what the finding names, or what cannot be told from it; -1: none did.
  int detected(const Finding& finding) const;

  Datasheet sheet_;
  std::vector<Watched> watched_;
  std::vector<Isolated> isolated_;
  BadChannels channels_;
  std::vector<bool> doubted_;  // one per channel: its transducer is known to be off
  bool weighs_all_ = false;    // an isolator overrules: that one says what could have been seen
  bool model_fits_ = true;
  bool quiet_ = false;  // no detector said anything
  bool running_ = false;
  double begin_ = 0;  // s
  Assessment assessment_;
};

// What a detector's detection means, by its words in the datasheet: kind, effect, port, text.
Finding meaning_of(const StageSpec& detector);

}  // namespace faultline
