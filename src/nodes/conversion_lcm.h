// Between the core's data and LCM types. The DAQ's clock counts microseconds: exact in a stamp, and turned into seconds
// by way of a stamp, so that a sample has the same time whether it is seen before or after it went through ROS.
#pragma once

#include <string>

#include <faultline_lcm/rig_description_t.hpp>
#include <faultline_lcm/sample_t.hpp>

#include "faultline/rig/datasheet.h"
#include "faultline/signal/sample.h"
#include "nodes/description.h"

namespace faultline {

// Reads a message from the bytes of a packet or a log. False where they are of another type, or a length in them does
// not fit how many they are: what lcm-gen generates makes room for as many items as a message says it has, before it
// looks whether they are there.
bool decode(const void* data, int size, faultline_lcm::sample_t& message);
bool decode(const void* data, int size, faultline_lcm::rig_description_t& message);

// Rounds the time to the microsecond.
faultline_lcm::sample_t to_lcm(const Sample& sample);
// Throws InputError for a time that a stamp cannot hold, a negative sequence number, a count that is not the values'.
Sample from_lcm(const faultline_lcm::sample_t& message);

faultline_lcm::rig_description_t to_lcm(const Datasheet& sheet);
Description from_lcm(const faultline_lcm::rig_description_t& message);

}  // namespace faultline
