#include "faultline/numerics/quantiles.h"

#include <algorithm>

#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/students_t.hpp>

namespace faultline {

double chi_squared_quantile_above(double freedom, double p) {
  return boost::math::quantile(boost::math::complement(boost::math::chi_squared(freedom), p));
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double student_ninety_percent(double freedom) { return boost::math::quantile(boost::math::students_t(freedom), 0.95); }

}  // namespace faultline
