// What a diagnosis node hears of its rig: samples in the datasheet's order, their stream watched for loss, and its
// state told. Subscribes to /RIG/description and /RIG/sample when start() is called; `deliver` runs in ROS callbacks
// and must not block.
#pragma once

#include <functional>

#include <diagnostic_updater/DiagnosticStatusWrapper.h>
#include <ros/node_handle.h>

#include "faultline/rig/datasheet.h"
#include "faultline/signal/sequence_monitor.h"
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
  const Datasheet& sheet_;
  ros::NodeHandle node_;
  SampleGate gate_;
  SequenceMonitor monitor_;
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
