#include "nodes/node_health.h"

#include "nodes/node_main.h"

namespace faultline {

double RateMeter::rate(std::uint64_t count) {
  const double now = steady_seconds();
  const double elapsed = now - last_time_;
  const double result = last_time_ < 0 || elapsed <= 0 ? 0 : static_cast<double>(count - last_count_) / elapsed;
  last_count_ = count;
  last_time_ = now;
  return result;
}

NodeHealth::NodeHealth(const std::string& rig, const std::string& task, Fill fill) {
  updater_.setHardwareID(rig);
  updater_.add(task, [this, fill](diagnostic_updater::DiagnosticStatusWrapper& status) {
    fill(status);
    if (clock_.missing(steady_seconds(), without_clock()))
      status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN, kWithoutClock);
  });
  timer_ = ros::NodeHandle().createWallTimer(ros::WallDuration(1),
                                             [this](const ros::WallTimerEvent&) { updater_.force_update(); });
}

}  // namespace faultline
