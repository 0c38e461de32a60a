#include "nodes/conversion_lcm.h"

#include <cmath>
#include <cstdint>

#include <fmt/format.h>
#include <ros/time.h>

#include "faultline/signal/error.h"

namespace faultline {

faultline_lcm::sample_t to_lcm(const Sample& sample) {
  faultline_lcm::sample_t message;
  message.timestamp_us = static_cast<std::int64_t>(std::llround(sample.time * 1e6));
  message.sequence = static_cast<std::int64_t>(sample.sequence);
  message.count = static_cast<std::int32_t>(sample.values.size());
  message.values = sample.values;
  return message;
}

Sample from_lcm(const faultline_lcm::sample_t& message) {
  constexpr std::int64_t kMicro = 1000000;
  if (message.timestamp_us < 0 || message.timestamp_us / kMicro >= INT64_C(4294967295))
    throw InputError(
        fmt::format("LCM sample {}: timestamp {} us does not fit a ROS stamp", message.sequence, message.timestamp_us));
  if (message.sequence < 0)
    throw InputError(fmt::format("LCM sample: sequence number {} is negative", message.sequence));
  if (message.count < 0 || static_cast<std::size_t>(message.count) != message.values.size())
    throw InputError(
        fmt::format("LCM sample {}: count {} but {} values", message.sequence, message.count, message.values.size()));
  Sample sample;
  sample.time = ros::Time(static_cast<std::uint32_t>(message.timestamp_us / kMicro),
                          static_cast<std::uint32_t>(message.timestamp_us % kMicro * 1000))
                    .toSec();
  sample.sequence = static_cast<std::uint64_t>(message.sequence);
  sample.values = message.values;
  return sample;
}

faultline_lcm::rig_description_t to_lcm(const Datasheet& sheet) {
  faultline_lcm::rig_description_t message;
  message.rig = sheet.rig;
  message.sample_period = sheet.sample_period;
  message.count = static_cast<std::int32_t>(sheet.channels.size());
  for (const Channel& channel : sheet.channels) {
    message.names.push_back(channel.name);
    message.units.push_back(channel.unit);
  }
  return message;
}

Description from_lcm(const faultline_lcm::rig_description_t& message) {
  Description description;
  description.rig = message.rig;
  description.sample_period = message.sample_period;
  description.names = message.names;
  description.units = message.units;
  return description;
}

std::string lcm_channel(const std::string& rig, const std::string& name) { return rig + "." + name; }

}  // namespace faultline
