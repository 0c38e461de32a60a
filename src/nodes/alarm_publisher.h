// Hosts the alarm stage of a rig: /RIG/estimate in; /RIG/alarms (latched) and /diagnostics out, at once when an alarm
// is raised, ends or changes level, and once a second of wall time. Alarms follow from the estimates' stamps alone; see
// silence_watch.h for silence. Whether the rig is silent is judged by /RIG/sample: an estimator may think longer than
// the rig pauses. While estimates are behind the samples, /diagnostics says so (STALE) and nobody calls the rig silent;
// neither is it after a run that its source ended (/RIG/end).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <ros/node_handle.h>

#include "faultline/alarms/alarm_stage.h"
#include "faultline/alarms/estimate_join.h"
#include "faultline/signal/sequence_monitor.h"
#include "nodes/alarm_diagnostics.h"
#include "nodes/alarm_history.h"
#include "nodes/messages.h"
#include "nodes/node_health.h"
#include "nodes/silence_watch.h"

namespace faultline {

class AlarmPublisher {
 public:
  // Listens to the estimates of all the rig's estimators. `patience`: s, see SilenceWatch. `reference`: a file of what
  // detectors and isolators learnt; judged by if it is there, and written as far as they have still to learn; empty:
  // none. InputError where it is refused. `history`: see AlarmBefore.
  AlarmPublisher(const Datasheet& sheet, double patience, const std::string& reference, const std::string& history);

 private:
  void take(const faultline_msgs::Estimate& message);
  void hear_samples();
  // s of the samples' clock; 0 while no sample was heard.
  double behind() const;
  void watch();  // ten times a second
  void publish();
  void each_second();
  void keep_reference();
  void tell(diagnostic_updater::DiagnosticStatusWrapper& status);
  double simulated_seconds() const;

  const Datasheet& sheet_;
  std::string name_;  // of the rig in this graph: the node's namespace, else the rig's name
  AlarmStage stage_;
  EstimateJoin join_;
  std::vector<Estimate> estimates_of_sample_;
  SequenceMonitor monitor_;
  SilenceWatch silence_;
  AlarmBefore before_;
  ClosedStatuses closed_;
  ros::NodeHandle node_, private_node_{"~"};
  ros::Publisher alarms_, diagnostics_;
  ros::Subscriber estimates_, samples_, end_;
  ros::WallTimer watch_timer_, second_timer_;
  std::string reference_, reference_trouble_;
  std::size_t kept_ = 0;           // detectors and isolators in that file
  double heard_ = 0, judged_ = 0;  // s, the last sample's time and the last estimate's
  double run_end_ = 0;             // s, the time of the last sample of a run that its source said is over
  double judged_at_ = 0;           // s, steady time of the latter
  std::uint64_t published_changes_ = 0, kept_changes_ = 0, bad_ = 0, other_stage_ = 0;
  SequenceCounts told_;
  RateMeter rate_;
  NodeHealth health_;
};

}  // namespace faultline
