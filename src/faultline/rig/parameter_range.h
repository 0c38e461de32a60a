// How far a parameter may be off the datasheet.
#pragma once

#include <algorithm>

#include "faultline/rig/datasheet.h"

namespace faultline {

// Of its nominal value, what a parameter keeps: with less or with the other sign it is another rig.
constexpr double kLeastParameterFraction = 0.1;

// Lowest deviation in tolerances of a parameter that may be off by `farthest` of them.
inline double lowest_deviation(const Parameter& parameter, double farthest) {
  return -std::min(farthest, (1 - kLeastParameterFraction) / parameter.tolerance);
}

}  // namespace faultline
