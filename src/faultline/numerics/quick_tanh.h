// tanh by one exponential, in half the time of std::tanh. The error is of the size of the last digit of 1, so
// it is relative to 1, not to the value: for saturating functions, not for small arguments that must keep their digits.
#pragma once

#include <cmath>

namespace faultline {

inline double quick_tanh(double x) { return 1 - 2 / (std::exp(2 * x) + 1); }

}  // namespace faultline
