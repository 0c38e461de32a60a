// Mass flow of air through an orifice, adiabatic, ideal gas, no upstream velocity (Manninen 2012, equations 4 and 5):
//
//   m = C A p_1 Psi(p_2/p_1) sqrt(2/(R T)),  from 1 to 2; where p_2 > p_1 it flows back
//   Psi(r) = 0.4842                                    r <= 0.5283, choked
//            sqrt(3.5 (r^(2/gamma) - r^(1 + 1/gamma))) r < 0.99; the source misprints the first exponent as gamma/gamma
//            linear to 0 at r = 1                      above, where the slope of the root has no bound
//
// gamma = 1.4. Pressures absolute in Pa, C A in m^2, R T in J/kg, m in kg/s.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace faultline {

// r^(2/7) from 0.5 to 1 by cubics through values and slopes at points 1/512 apart: within 5e-13 of it.
class TwoSevenths {
 public:
  TwoSevenths() {
    for (std::size_t i = 0; i < kIntervals; ++i) {
      const double width = 0.5 / kIntervals, from = 0.5 + static_cast<double>(i) * width, to = from + width;
      const double y0 = std::pow(from, 2.0 / 7), y1 = std::pow(to, 2.0 / 7);
      const double slope0 = width * 2 / 7 * y0 / from, slope1 = width * 2 / 7 * y1 / to;
      cubics_[i] = {y0, slope0, 3 * (y1 - y0) - 2 * slope0 - slope1, 2 * (y0 - y1) + slope0 + slope1};
    }
  }
  double operator()(double r) const {
    const double place = (r - 0.5) * (2 * kIntervals);
    const auto i = static_cast<std::size_t>(place);
    const double x = place - static_cast<double>(i);
    const std::array<double, 4>& c = cubics_[i];
    return c[0] + x * (c[1] + x * (c[2] + x * c[3]));
  }

 private:
  static constexpr std::size_t kIntervals = 256;
  std::array<std::array<double, 4>, kIntervals> cubics_;
};

inline const TwoSevenths two_sevenths;

inline double flow_function(double ratio) {
  constexpr double kCritical = 0.528282, kChoked = 0.484178, kLaminar = 0.99;
  if (ratio <= kCritical) return kChoked;
  const double root = two_sevenths(ratio < kLaminar ? ratio : kLaminar);
  const double square = root * root;
  const double subsonic = std::sqrt(3.5 * square * square * root * (1 - root));  // r^(10/7) - r^(12/7)
  return ratio < kLaminar ? subsonic : subsonic * (1 - ratio) / (1 - kLaminar);
}

// `root`: sqrt(2/(R T)), which many orifices share.
inline double air_flow(double area, double from, double to, double root) {
  if (to > from) return -area * to * flow_function(from / to) * root;
  return area * from * flow_function(to / from) * root;
}

}  // namespace faultline
