// Hosts a rig's detectors and isolators: /RIG/estimate in; /RIG/detections and /RIG/hypotheses out, one message each a
// sample. Only header stamps matter: the same stages offline say the same of the same estimates.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <ros/node_handle.h>

#include "faultline/alarms/estimate_join.h"
#include "faultline/isolation/isolation_stage.h"
#include "faultline/signal/sequence_monitor.h"
#include "nodes/messages.h"
#include "nodes/node_health.h"
#include "nodes/node_main.h"

namespace faultline {

class IsolationHost {
 public:
  // Listens to the estimates of all the rig's estimators, once those who must hear its own results do. `reference`: a
  // file of what detectors and isolators learnt; judged by if it is there, and written as far as they have still to
  // learn; empty: none. InputError where it is refused.
  IsolationHost(const Datasheet& sheet, const std::string& reference, Listeners listeners);

 private:
  void take(const faultline_msgs::Estimate& message);
  void keep_reference();
  void tell(diagnostic_updater::DiagnosticStatusWrapper& status);

  const Datasheet& sheet_;
  IsolationStage stage_;
  EstimateJoin join_;
  std::vector<Estimate> estimates_of_sample_;
  SequenceMonitor monitor_;
  ros::NodeHandle node_;
  ros::Publisher detections_, hypotheses_;
  ros::Subscriber estimates_;
  ros::WallTimer second_timer_;
  std::string reference_, reference_trouble_;
  std::size_t kept_ = 0;  // detectors and isolators in that file
  std::uint64_t bad_ = 0, other_stage_ = 0;
  SequenceCounts told_;
  Rise bad_rise_;
  RateMeter rate_;
  NodeHealth health_;
};

}  // namespace faultline
