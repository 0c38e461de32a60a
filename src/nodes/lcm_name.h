// By which name a rig is known on LCM: its channels are NAME.sample and NAME.description. Two rigs of one kind on one
// network need one each, or each would hear both.
#pragma once

#include <string>

#include "nodes/parameters.h"

namespace faultline {

// Parameter ~lcm_name, empty where it is not given. InputError for a name that LCM cannot carry.
std::string read_lcm_name(Parameters& parameters);

// NAME.sample, NAME.description
std::string lcm_channel(const std::string& name, const std::string& what);
// The name in front of .`what`; empty if the channel is none of these.
std::string lcm_name_of(const std::string& channel, const std::string& what);

// The name that a log was recorded with: `wanted` if it is not empty, else the only one whose samples can be of `rig`.
// InputError where it is not in the log, or where several can be meant. Reads the log up to 10 s behind its first
// sample, or until `wanted` is found.
std::string find_lcm_name(const std::string& log, const std::string& rig, const std::string& wanted);

}  // namespace faultline
