#include "faultline/numerics/quick_power.h"

#include <gtest/gtest.h>

namespace faultline {
namespace {

TEST(QuickPower, IsThePower) {
  for (const double exponent : {-3.0 / 14, 0.25, -1.0}) {
    const QuickPower power(exponent);
    for (double y = 1e-300; y < 1e300; y *= 1.0037)
      EXPECT_NEAR(power(y) / std::pow(y, exponent), 1, 1e-12) << y << " ^ " << exponent;
  }
  EXPECT_TRUE(std::isnan(QuickPower(0.5)(std::nan(""))) || QuickPower(0.5)(std::nan("")) > 0);
}

}  // namespace
}  // namespace faultline
