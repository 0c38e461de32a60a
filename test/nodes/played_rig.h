// A rig that a rostest plays, in simulated time of which the test is the clock: it sends description and samples in the
// namespace of a rig's nodes and keeps what they say. Wall time is only for giving up.
#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <string>
#include <thread>

#include <diagnostic_msgs/DiagnosticArray.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Clock.h>

#include "faultline/alarms/alarm.h"
#include "faultline/rig/datasheet.h"
#include "nodes/conversion.h"
#include "nodes/node_main.h"

namespace faultline {

// Lets ROS work until something holds.
inline bool until(const std::function<bool()>& holds, double seconds) {
  for (const double end = steady_seconds() + seconds; !holds();) {
    if (steady_seconds() > end || !ros::ok()) return false;
    ros::spinOnce();
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

class PlayedRig {
 public:
  // `name`: the namespace; `clock`: /clock, which several rigs share.
  PlayedRig(const Datasheet& sheet, const std::string& name, const ros::Publisher& clock)
      : rig_(sheet.rig), name_(name), clock_(clock) {
    description_ = node_.advertise<faultline_msgs::RigDescription>("/" + name + "/description", 1, true);
    samples_ = node_.advertise<faultline_msgs::Sample>("/" + name + "/sample", kQueue);
    description_.publish(to_message(sheet, "a test"));
    const ros::TransportHints fast = ros::TransportHints().tcpNoDelay();
    alarms_ = node_.subscribe<faultline_msgs::AlarmArray>(
        "/" + name + "/alarms", 1000,
        [this](const faultline_msgs::AlarmArray::ConstPtr& message) { report_ = from_message(*message); }, {}, fast);
    diagnostics_ = node_.subscribe<diagnostic_msgs::DiagnosticArray>(
        "/diagnostics", 1000, [this](const diagnostic_msgs::DiagnosticArray::ConstPtr& message) {
          for (const diagnostic_msgs::DiagnosticStatus& status : message->status)
            if (status.name.rfind(name_ + "/", 0) == 0 || status.name.rfind(name_ + ":", 0) == 0)
              statuses_[status.name] = status;
        });
  }

  // Whether kalman_node and alarm_node hear it and are heard.
  bool connected() const {
    return samples_.getNumSubscribers() >= 2 && alarms_.getNumPublishers() >= 1 &&
           diagnostics_.getNumPublishers() >= 3 && clock_.getNumSubscribers() >= 3;
  }

  // The clock goes with the samples, more finely than what counts as silence.
  void send(const Sample& sample) {
    samples_.publish(to_message(sample, rig_));
    last_ = sample.time;
    if (++sent_ % 10 != 0) return;
    rosgraph_msgs::Clock message;
    message.clock = to_stamp(last_);
    clock_.publish(message);
  }
  // Sends a recording from `start` [s] on, 5000 samples of it at a time; whether all was judged.
  bool send(const Recording& recording, double start) {
    for (std::size_t row = 0; row < recording.rows(); ++row) {
      Sample sample = recording.sample(row);
      sample.time = to_seconds(to_stamp(start + sample.time));
      sample.sequence = row;
      send(sample);
      if (row % 5000 == 0 && !judged()) return false;
    }
    return judged();
  }
  // Waits until what was sent is judged.
  bool judged() const {
    return until([this] { return report_.time == last_; }, 20);
  }

  const AlarmReport& report() const { return report_; }
  // By their names, which begin with the rig's.
  const std::map<std::string, diagnostic_msgs::DiagnosticStatus>& statuses() const { return statuses_; }
  // Of the status whose name begins so; -1 where there is none.
  int level(const std::string& begin) const {
    const auto found = statuses_.lower_bound(begin);
    return found != statuses_.end() && found->first.rfind(begin, 0) == 0 ? found->second.level : -1;
  }

 private:
  std::string rig_, name_;
  ros::NodeHandle node_;
  ros::Publisher clock_, description_, samples_;
  ros::Subscriber alarms_, diagnostics_;
  AlarmReport report_;
  std::map<std::string, diagnostic_msgs::DiagnosticStatus> statuses_;
  double last_ = 0;  // s
  std::uint64_t sent_ = 0;
};

}  // namespace faultline
