// Signed square root with a laminar transition: y / (y^2 + d^2)^(1/4), which is sgn(y) sqrt|y| for |y| >> d and
// y/sqrt(d) near 0. Turbulent flow through an orifice is a coefficient times this of the pressure drop; y and d in Pa.
#pragma once

#include <cmath>
#include <utility>

namespace faultline {

// Far above d the series in x = (d/y)^2 are exact to 2e-13 and wait for one root instead of two.
constexpr double kFarDrop = 100;  // d

inline double signed_root(double drop, double transition) {
  const double size = std::abs(drop);
  if (size > kFarDrop * transition) {
    const double share = transition / size, x = share * share;
    return std::copysign(std::sqrt(size), drop) * (1 - x * (0.25 - 0.15625 * x));
  }
  return drop / std::sqrt(std::sqrt(drop * drop + transition * transition));
}

// Value and derivative.
inline std::pair<double, double> signed_root_and_slope(double drop, double transition) {
  const double size = std::abs(drop);
  if (size > kFarDrop * transition) {
    const double share = transition / size, x = share * share, root = std::sqrt(size);
    return {std::copysign(root, drop) * (1 - x * (0.25 - 0.15625 * x)),
            root * share * (0.5 + x * (0.375 - 0.546875 * x)) / transition};
  }
  const double square = drop * drop, sum = square + transition * transition, p = 1 / std::sqrt(std::sqrt(sum));
  return {drop * p, p * (1 - 0.5 * square / sum)};
}

}  // namespace faultline
