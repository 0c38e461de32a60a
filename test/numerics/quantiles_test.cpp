// Quantiles against tables, and as the inverse of the distribution where no table reaches.
#include "faultline/numerics/quantiles.h"

#include <gtest/gtest.h>

#include <cmath>

#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>

namespace faultline {
namespace {

TEST(Quantiles, NinetyPercentOfANormalDistribution) {
  EXPECT_NEAR(std::erf(kNinetyPercentSigmas / std::sqrt(2.0)), 0.9, 1e-15);
  EXPECT_DOUBLE_EQ(kNinetyPercentSigmas, boost::math::quantile(boost::math::normal(), 0.95));
}

TEST(Quantiles, ChiSquaredOfTables) {
  EXPECT_NEAR(chi_squared_quantile_above(1, 0.05), 3.841459, 1e-6);
  EXPECT_NEAR(chi_squared_quantile_above(10, 0.05), 18.307038, 1e-6);
  EXPECT_NEAR(chi_squared_quantile_above(100, 0.001), 149.449253, 1e-6);
}

TEST(Quantiles, ChiSquaredFarOut) {
  // What an innovation test may ask for: windows up to 1e7 samples, a false alarm in 1e18 tests.
  for (const double freedom : {3.0, 199.0, 2e7 - 1})
    for (const double p : {0.5, 1e-9, 1e-18}) {
      const double x = chi_squared_quantile_above(freedom, p);
      const double back = boost::math::cdf(boost::math::complement(boost::math::chi_squared(freedom), x));
      EXPECT_NEAR(back / p, 1, 1e-6) << freedom << " degrees, " << p;
    }
}

}  // namespace
}  // namespace faultline
