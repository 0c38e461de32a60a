// A node's own state on /diagnostics: once a second of wall time, so that a stopped /clock does not hide it.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/node_handle.h>

#include "nodes/clock_watch.h"

namespace faultline {

// Messages per second of wall time since the last time it was asked.
class RateMeter {
 public:
  double rate(std::uint64_t count);

 private:
  std::uint64_t last_count_ = 0;
  double last_time_ = -1;
};

// Whether a count of troubles went up since the last report: a warning is to end when its trouble does, while the total
// stays among the values.
class Rise {
 public:
  bool since_last(std::uint64_t count) {
    const bool rose = count > last_;
    last_ = count;
    return rose;
  }

 private:
  std::uint64_t last_ = 0;
};

class NodeHealth {
 public:
  using Fill = std::function<void(diagnostic_updater::DiagnosticStatusWrapper&)>;
  // `fill` runs in the thread that spins ROS. A clock that is missing is told beside what it says.
  NodeHealth(const std::string& rig, const std::string& task, Fill fill);

 private:
  ClockWatch clock_;
  diagnostic_updater::Updater updater_;
  ros::WallTimer timer_;
};

}  // namespace faultline
