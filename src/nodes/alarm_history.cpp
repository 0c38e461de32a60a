#include "nodes/alarm_history.h"

#include <algorithm>

#include <ros/ros.h>
#include <ros/serialization.h>

#include "nodes/conversion.h"

namespace faultline {
namespace {

constexpr std::ptrdiff_t kMost = 100;  // alarms: more than anybody reads, and little for the master to hold

}  // namespace

AlarmBefore::AlarmBefore(const std::string& rig, const std::string& kept) {
  if (kept.empty()) return;
  try {
    faultline_msgs::AlarmArray message;
    std::string bytes = kept;
    ros::serialization::IStream stream(reinterpret_cast<std::uint8_t*>(bytes.data()),
                                       static_cast<std::uint32_t>(bytes.size()));
    ros::serialization::deserialize(stream, message);
    AlarmReport report = from_message(message);
    if (report.rig != rig) {
      ROS_WARN("~history is of the rig %s; left out", report.rig.c_str());
      return;
    }
    time_ = report.time;
    alarms_ = std::move(report.alarms);
    for (Alarm& alarm : alarms_) {
      if (!alarm.active) continue;
      alarm.active = false;
      alarm.text += " (until the alarm node was started again)";
    }
  } catch (const std::exception& error) {
    ROS_WARN("~history cannot be read (%s); left out", error.what());
  }
}

AlarmReport AlarmBefore::with(AlarmReport now) {
  if (now.time > 0 && now.time < time_) alarms_.clear();
  now.alarms.insert(now.alarms.begin(), alarms_.begin(), alarms_.end());
  return now;
}

std::vector<std::uint8_t> to_bytes(AlarmReport report) {
  const auto surplus = static_cast<std::ptrdiff_t>(report.alarms.size()) - kMost;
  if (surplus > 0) report.alarms.erase(report.alarms.begin(), report.alarms.begin() + surplus);
  const faultline_msgs::AlarmArray message = to_message(report);
  std::vector<std::uint8_t> bytes(ros::serialization::serializationLength(message));
  ros::serialization::OStream stream(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  ros::serialization::serialize(stream, message);
  return bytes;
}

}  // namespace faultline
