// Keeps the alarms of a rig: /RIG/detections and /RIG/hypotheses in; /RIG/alarms (latched) and /diagnostics out, at
// once when an alarm is raised, ends or changes level, when a run is judged to its end (/RIG/end), and once a second of
// wall time. Alarms follow from the samples' stamps alone; see silence_watch.h for silence. Whether it is silent is
// judged by /RIG/sample: an estimator may think longer than the rig pauses. While judgements are behind the samples,
// /diagnostics says so (STALE) and nobody calls the rig silent; neither is it after a run that its source ended. The
// last samples of a source that dies may have come here and not to the estimators, so a judgement is awaited for a few
// seconds without a sample or a judgement, and then no longer.
#pragma once

#include <cstdint>
#include <string>

#include <ros/node_handle.h>

#include "faultline/alarms/alarm_keeper.h"
#include "faultline/signal/sequence_monitor.h"
#include "nodes/alarm_diagnostics.h"
#include "nodes/alarm_history.h"
#include "nodes/assessment_messages.h"
#include "nodes/messages.h"
#include "nodes/node_health.h"
#include "nodes/silence_watch.h"

namespace faultline {

class AlarmPublisher {
 public:
  // `patience`: s, see SilenceWatch. `history`: see AlarmBefore.
  AlarmPublisher(const Datasheet& sheet, double patience, const std::string& history);
  // The node ends: what an aggregator heard of is OK, for nobody will say it again.
  void close();

 private:
  void take_pairs();
  void hear(double sample_time);
  // s of the samples' clock; 0 while no sample was heard.
  double behind() const;
  bool pending() const;  // samples came that are not judged
  bool awaited() const;  // and their judgements may still come
  void watch();          // ten times a second
  void publish();
  void each_second();
  void tell(diagnostic_updater::DiagnosticStatusWrapper& status);
  double simulated_seconds() const;

  const Datasheet& sheet_;
  std::string name_;  // of the rig in this graph: the node's namespace, else the rig's name
  AlarmKeeper keeper_;
  AssessmentJoin join_;
  SequenceMonitor monitor_;
  SilenceWatch silence_;
  AlarmBefore before_;
  ClosedStatuses closed_;
  ros::NodeHandle node_, private_node_{"~"};
  ros::Publisher alarms_, diagnostics_;
  ros::Subscriber detections_, hypotheses_, samples_, end_;
  ros::WallTimer watch_timer_, second_timer_;
  double heard_ = 0, judged_ = 0;  // s, the last sample's time and the last judgement's
  double heard_at_ = 0;            // s, steady time of the former
  std::uint64_t unjudged_ = 0;     // samples heard since the last judgement
  double run_end_ = 0;             // s, the time of the last sample of a run that its source said is over
  double judged_at_ = 0;           // s, steady time of the latter
  std::uint64_t published_changes_ = 0, kept_changes_ = 0, bad_ = 0;
  SequenceCounts told_;
  Rise bad_rise_;
  RateMeter rate_;
  NodeHealth health_;
};

}  // namespace faultline
