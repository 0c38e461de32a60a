#include "nodes/end_of_run.h"

#include <chrono>
#include <thread>

#include <ros/ros.h>

#include "nodes/conversion.h"
#include "nodes/node_main.h"

namespace faultline {
namespace {

constexpr double kPatience = 10;  // s of wall time without progress
constexpr double kConnect = 1;    // s

}  // namespace

EndOfRun::EndOfRun()
    : end_(node_.advertise<std_msgs::Time>("end", 1)),
      alarms_(node_.subscribe<faultline_msgs::AlarmArray>(
          "alarms", 10, [this](const boost::shared_ptr<const faultline_msgs::AlarmArray>& message) {
            judged_ = message->header.stamp;
          })) {}

void EndOfRun::tell(double last) {
  for (const double end = steady_seconds() + kConnect; end_.getNumSubscribers() == 0 && steady_seconds() < end;)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  end_.publish(end_of_run(last));
  ros::Time before;
  for (double moved = steady_seconds(); ros::ok() && alarms_.getNumPublishers() > 0 && judged_ != to_stamp(last);) {
    if (judged_ != before) moved = steady_seconds();
    before = judged_;
    if (steady_seconds() - moved > kPatience) {
      ROS_WARN("the run ended at %.3f s, but the alarms stay at %.3f s: its end is not judged", last,
               to_seconds(judged_));
      return;
    }
    ros::spinOnce();
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  linger();  // listeners to the alarms hear the last
}

}  // namespace faultline
