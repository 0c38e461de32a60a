// Signed square root with a laminar transition: y / (y^2 + d^2)^(1/4), which is sgn(y) sqrt|y| for |y| >> d and
// y/sqrt(d) near 0. Turbulent flow through an orifice is a coefficient times this of the pressure drop; y and d in Pa.
#pragma once

#include <cmath>

namespace faultline {

inline double signed_root(double drop, double transition) {
  // Far above d the series (1 + x)^(-1/4), x = (d/y)^2, is exact to 2e-13 and waits for one root instead of two.
  constexpr double kFar = 100;
  const double size = std::abs(drop);
  if (size > kFar * transition) {
    const double share = transition / size, x = share * share;
    return std::copysign(std::sqrt(size), drop) * (1 - x * (0.25 - 0.15625 * x));
  }
  return drop / std::sqrt(std::sqrt(drop * drop + transition * transition));
}

}  // namespace faultline
