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

#include "faultline/numerics/cubic_table.h"

namespace faultline {

// 3.5 (r^(10/7) - r^(12/7)) and its derivative.
inline double subsonic_square(double r) { return 3.5 * (std::pow(r, 10.0 / 7) - std::pow(r, 12.0 / 7)); }
inline double subsonic_square_slope(double r) { return 5 * std::pow(r, 3.0 / 7) - 6 * std::pow(r, 5.0 / 7); }

constexpr double kCritical = 0.528282, kChoked = 0.484178, kLaminar = 0.99;  // ratios, Psi between them

// Within 1e-10.
inline const CubicTable<2048> subsonic(
    0.528, kLaminar, [](double r) { return std::sqrt(subsonic_square(r)); },
    [](double r) { return 0.5 * subsonic_square_slope(r) / std::sqrt(subsonic_square(r)); });
inline const double laminar_slope = std::sqrt(subsonic_square(kLaminar)) / (1 - kLaminar);

inline double flow_function(double ratio) {
  if (ratio <= kCritical) return kChoked;
  return ratio < kLaminar ? subsonic(ratio) : laminar_slope * (1 - ratio);
}

// `root`: sqrt(2/(R T)), which many orifices share.
inline double air_flow(double area, double from, double to, double root) {
  if (to > from) return -area * to * flow_function(from / to) * root;
  return area * from * flow_function(to / from) * root;
}

}  // namespace faultline
