#include "faultline/numerics/quantiles.h"

#include <boost/math/distributions/chi_squared.hpp>

namespace faultline {

double chi_squared_quantile_above(double freedom, double p) {
  return boost::math::quantile(boost::math::complement(boost::math::chi_squared(freedom), p));
}

}  // namespace faultline
