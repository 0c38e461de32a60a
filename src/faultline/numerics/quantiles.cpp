#include "faultline/numerics/quantiles.h"

#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/students_t.hpp>

namespace faultline {

double chi_squared_quantile_above(double freedom, double p) {
  return boost::math::quantile(boost::math::complement(boost::math::chi_squared(freedom), p));
}

double student_ninety_percent(double freedom) { return boost::math::quantile(boost::math::students_t(freedom), 0.95); }

}  // namespace faultline
