// Where rigs outside this tree are: in the ROS packages that depend on faultline and export one (where the environment
// has a ROS_PACKAGE_PATH), and in the folders that FAULTLINE_RIG_PATH lists with : between. See rig/rig_library.h.
#pragma once

#include <string>
#include <vector>

#include "faultline/rig/rig_library.h"

namespace faultline {

const std::vector<RigPlace>& outside_rigs();  // looked for once

// What is wrong with rigs other than the one that is asked for: one line each.
std::vector<std::string> left_out(const std::string& asked_for);

}  // namespace faultline
