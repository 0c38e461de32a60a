// What a diagnosis node hears of its rig: samples in the datasheet's order, their stream watched for loss and for what
// sources do wrong (stream_watch.h), and its state told. Subscribes to /RIG/description and /RIG/sample when start() is
// called; `deliver` runs in ROS callbacks and must not block.
//
// One node is the source of samples: the first that sent some, as long as it is connected. Samples of a second one
// would be read as restarts without end, so they are left out, counted and told. Where descriptions contradict, the
// source's own counts. Warnings are told while they last.
#pragma once

#include <functional>
#include <map>
#include <string>

#include <diagnostic_updater/DiagnosticStatusWrapper.h>
#include <ros/node_handle.h>

#include "faultline/rig/datasheet.h"
#include "faultline/signal/run_start.h"
#include "faultline/signal/sequence_monitor.h"
#include "faultline/signal/stream_watch.h"
#include "nodes/messages.h"
#include "nodes/node_health.h"
#include "nodes/sample_gate.h"

namespace faultline {

class RigInput {
 public:
  RigInput(const Datasheet& sheet, std::function<void(const Sample&)> deliver);
  void start();
  // Summary and counts. Warns of what was lost since the last call, of a silent rig, of samples that do not fit.
  void tell(diagnostic_updater::DiagnosticStatusWrapper& status);
  const SequenceCounts& counts() const { return monitor_.counts(); }

 private:
  void take(const Sample& sample);
  void describe(const std::string& publisher, const Description& description);
  void use_description();
  bool is_source(const std::string& publisher);
  // Of the descriptions that are published now; empty if they agree.
  std::string contradiction() const;

  const Datasheet& sheet_;
  std::function<void(const Sample&)> deliver_;
  ros::NodeHandle node_;
  SampleGate gate_;
  SequenceMonitor monitor_;
  StreamWatch stream_;
  std::string source_, other_;  // publishers of samples: the one that counts, the last of those left out
  std::map<std::string, Description> descriptions_;  // by publisher
  std::string described_by_;                         // whose counts
  RunStart run_start_;
  std::uint64_t foreign_ = 0;
  std::uint64_t told_missed_ = 0, told_foreign_ = 0, told_refused_ = 0;
  ros::Subscriber description_, samples_;
  ros::WallTimer timer_;
  RateMeter rate_;
  SequenceCounts told_;
};

// The settings of a monitor of this rig's samples.
SequenceSettings sequence_settings(const Datasheet& sheet);
// Adds counts; warns if samples were lost since `told`.
void tell_counts(const SequenceCounts& counts, SequenceCounts& told,
                 diagnostic_updater::DiagnosticStatusWrapper& status);

}  // namespace faultline
