// Reads the messages of a ROS bag (format 2.0) in the order in which they were written, chunk by chunk, at the speed of
// the decompression. rosbag::View parses every message's header into a map of strings, twice: at 1 kHz that alone takes
// longer than the diagnosis. Source of the format: http://wiki.ros.org/Bags/Format/2.0
// Not read: encrypted bags and format 1.2. A bag without an index, or shorter than its index says, was cut off:
// InputError that names `rosbag reindex`.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>

#include <ros/time.h>

namespace faultline {

struct BagConnection {
  std::string topic;
  std::string type;      // package/Message
  std::string checksum;  // of the message's definition
};

struct BagMessage {
  const BagConnection* connection = nullptr;
  ros::Time received;
  std::uint8_t* data = nullptr;  // serialised; valid during the call
  std::uint32_t size = 0;
};

// Calls `take` for every message. All connections are known before the first call with their first message.
void read_bag_messages(const std::string& file, const std::function<void(const BagMessage&)>& take);

}  // namespace faultline
