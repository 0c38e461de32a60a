// tanh from a table, within 1e-10 and in a quarter of the time of std::tanh: for saturating functions, not for small
// arguments that must keep their digits.
#pragma once

#include <cmath>

#include "faultline/numerics/cubic_table.h"

namespace faultline {

inline const CubicTable<2048> tanh_of_positive(
    0, 19, [](double x) { return std::tanh(x); }, [](double x) { return 1 - std::tanh(x) * std::tanh(x); });

inline double quick_tanh(double x) {
  const double size = std::abs(x);
  if (tanh_of_positive.holds(size)) return std::copysign(tanh_of_positive(size), x);
  return std::isnan(x) ? x : std::copysign(1.0, x);
}

}  // namespace faultline
