// From the DAQ's LCM messages to /RIG/sample. Stamps are the DAQ's own. Samples in the wrong order and repeats are
// counted and left out, lost and late ones are counted; what does not decode or does not fit the datasheet is counted
// and never published. `take` is called from the thread that reads LCM, `tell` from the one that spins ROS.
#pragma once

#include <cstdint>
#include <mutex>
#include <set>
#include <string>

#include <diagnostic_updater/DiagnosticStatusWrapper.h>
#include <ros/node_handle.h>

#include "faultline/signal/sender_watch.h"
#include "faultline/signal/sequence_monitor.h"
#include "nodes/node_health.h"
#include "nodes/node_main.h"
#include "nodes/sample_gate.h"

namespace faultline {

class RigDriver {
 public:
  // Advertises, and publishes the latched description. `lcm_name`: of the channels (lcm_name.h).
  RigDriver(const Datasheet& sheet, const std::string& lcm_name, const std::string& made_by, Listeners& listeners);

  // One LCM message. `arrival`: s, of a clock that runs evenly. Of other channels only descriptions of rigs of this
  // kind are looked at: what goes by another name is told while nothing comes under this one.
  void take(const std::string& channel, const void* data, int size, double arrival);
  void flush(double arrival);  // no more will come, or none came for a while
  void tell(diagnostic_updater::DiagnosticStatusWrapper& status);

  std::uint64_t published() const;
  double last_time() const;  // s, of what was published
  std::string trouble() const;

 private:
  void deliver(const Sample& sample, double arrival);
  void note_other(const std::string& channel, const void* data, int size);
  std::string no_sample() const;

  const Datasheet& sheet_;
  std::string sample_channel_, description_channel_;
  ros::NodeHandle node_;
  ros::Publisher samples_, description_;
  mutable std::mutex mutex_;  // over all that follows
  SampleGate gate_;
  SenderWatch senders_;
  SequenceMonitor monitor_;
  SequenceCounts told_;
  Rise undecodable_rise_, unfit_rise_;
  RateMeter rate_;
  double last_time_ = 0;  // s, of what was published
  std::uint64_t published_ = 0, undecodable_ = 0, unfit_ = 0, told_refused_ = 0, told_foreign_ = 0;
  std::string last_unfit_;
  std::set<std::string> others_;  // other names under which rigs of this kind describe themselves
};

}  // namespace faultline
