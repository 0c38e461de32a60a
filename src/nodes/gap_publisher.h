// Hosts the live gap of a rig: /RIG/sample in; /RIG/gap (latched) at each segment; its state on /diagnostics once a
// second: a warning where the gap has left normal, an error from three times the limit. Samples are handed to a worker
// thread of low priority, since seeking the place takes a large part of a second; what the callback does is put one
// sample into a queue. A queue that is full (100 s at 1 kHz) drops its oldest half: the gap is then cut there, and
// /diagnostics says so. Where the datasheet does not say which gap is normal, the worker first learns it from
// simulations, which takes seconds to minutes: samples wait in the queue, and /diagnostics tells how far it is.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include <ros/node_handle.h>

#include "faultline/gap/live_gap.h"
#include "nodes/messages.h"
#include "nodes/node_health.h"
#include "nodes/rig_input.h"

namespace faultline {

// Pure; the stamp is the segment's last sample's.
faultline_msgs::Gap to_message(const LiveGapState& state, const std::string& rig);

class GapPublisher {
 public:
  explicit GapPublisher(const Datasheet& sheet);
  ~GapPublisher();
  GapPublisher(const GapPublisher&) = delete;
  GapPublisher& operator=(const GapPublisher&) = delete;
  void start();
  // Why the rig cannot be simulated: one line, after ROS was ended by it; empty if all is well.
  std::string refusal();

 private:
  void take(const Sample& sample);
  void work();
  bool learn();  // the normal gap; false: it came to nothing
  void judge(const Sample& sample);
  void tell(diagnostic_updater::DiagnosticStatusWrapper& status);
  void tell_gap(diagnostic_updater::DiagnosticStatusWrapper& status);

  const Datasheet& sheet_;
  std::optional<LiveGap> gap_;  // the worker's alone; none while the normal gap is learnt
  ros::NodeHandle node_;
  ros::Publisher gaps_;

  std::mutex guard_;  // of what stands until the next empty line
  std::condition_variable arrived_;
  std::deque<Sample> queue_;
  bool stop_ = false;
  LiveGapState state_;
  LiveGapCounts counts_;
  std::uint64_t dropped_ = 0;
  std::string failure_, refusal_;
  bool learning_ = false;
  std::size_t learnt_ = 0;  // simulations that are done
  double work_seconds_ = 0;

  std::uint64_t told_dropped_ = 0;
  RigInput input_;
  NodeHealth health_, gap_health_;
  std::thread worker_;
};

}  // namespace faultline
