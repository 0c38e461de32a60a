// Mass flow of air through an orifice, adiabatic, ideal gas, no upstream velocity (Manninen 2012, equations 4 and 5):
//
//   m = C A p_1 Psi(p_2/p_1) sqrt(2/(R T)),  from 1 to 2; where p_2 > p_1 it flows back
//   Psi(r) = 0.4842                                    r <= 0.5283, choked
//            sqrt(3.5 (r^(2/gamma) - r^(1 + 1/gamma))) r < 0.99; the source misprints the first exponent as gamma/gamma
//            linear to 0 at r = 1                      above, where the slope of the root has no bound
//
// gamma = 1.4. Pressures absolute in Pa, C A in m^2, R T in J/kg, m in kg/s.
#pragma once

#include <cmath>

namespace faultline {

inline double flow_function(double ratio) {
  constexpr double kCritical = 0.528282, kChoked = 0.484178, kLaminar = 0.99;
  if (ratio <= kCritical) return kChoked;
  const auto subsonic = [](double r) {
    const double root = std::pow(r, 2.0 / 7);
    const double square = root * root;
    return std::sqrt(3.5 * square * square * root * (1 - root));  // r^(10/7) - r^(12/7)
  };
  if (ratio < kLaminar) return subsonic(ratio);
  static const double last = subsonic(kLaminar);
  return last * (1 - ratio) / (1 - kLaminar);
}

// `root`: sqrt(2/(R T)), which many orifices share.
inline double air_flow(double area, double from, double to, double root) {
  if (to > from) return -area * to * flow_function(from / to) * root;
  return area * from * flow_function(to / from) * root;
}

}  // namespace faultline
