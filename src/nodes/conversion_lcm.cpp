#include "nodes/conversion_lcm.h"

#include <cmath>
#include <cstdint>

#include <fmt/format.h>
#include <ros/time.h>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr int kHash = 8;  // bytes of the type's hash, first in every message

// Lengths in a message: 32 bits with a sign, the highest byte first.
class Walk {
 public:
  Walk(const void* data, int size) : at_(static_cast<const std::uint8_t*>(data)), left_(size) { skip(kHash); }

  bool good() const { return left_ >= 0; }
  void skip(std::int64_t bytes) {
    if (left_ < 0 || bytes < 0 || bytes > left_) {
      left_ = -1;
      return;
    }
    at_ += bytes;
    left_ -= bytes;
  }
  std::int32_t number() {
    const std::uint8_t* from = at_;
    skip(4);
    if (!good()) return 0;
    return static_cast<std::int32_t>(static_cast<std::uint32_t>(from[0]) << 24 |
                                     static_cast<std::uint32_t>(from[1]) << 16 |
                                     static_cast<std::uint32_t>(from[2]) << 8 | from[3]);
  }
  void skip_text() {
    const std::int32_t length = number();  // with the zero at its end
    skip(length > 0 ? length : -1);
  }

 private:
  const std::uint8_t* at_;
  std::int64_t left_;
};

}  // namespace

bool decode(const void* data, int size, faultline_lcm::sample_t& message) {
  Walk walk(data, size);
  walk.skip(16);  // timestamp_us, sequence
  walk.skip(INT64_C(8) * walk.number());
  return walk.good() && message.decode(data, 0, size) >= 0;
}

bool decode(const void* data, int size, faultline_lcm::rig_description_t& message) {
  Walk walk(data, size);
  walk.skip_text();  // rig
  walk.skip(8);      // sample_period
  const std::int64_t texts = INT64_C(2) * walk.number();
  if (texts < 0) return false;
  for (std::int64_t i = 0; i < texts && walk.good(); ++i) walk.skip_text();  // names, units
  return walk.good() && message.decode(data, 0, size) >= 0;
}

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

}  // namespace faultline
