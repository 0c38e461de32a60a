// Signed square root with a laminar transition: y / (y^2 + d^2)^(1/4), which is sgn(y) sqrt|y| for |y| >> d and
// y/sqrt(d) near 0. Turbulent flow through an orifice is a coefficient times this of the pressure drop; y and d in Pa.
#pragma once

#include <cmath>

namespace faultline {

inline double signed_root(double drop, double transition) {
  return drop / std::sqrt(std::sqrt(drop * drop + transition * transition));
}

}  // namespace faultline
