// A quick tanh is tanh within 1e-10 of 1, everywhere.
#include "faultline/numerics/quick_tanh.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace faultline {
namespace {

TEST(QuickTanh, IsTanh) {
  for (double x = -1000; x <= 1000; x += x > -40 && x < 40 ? 1e-3 : 1)
    ASSERT_NEAR(quick_tanh(x), std::tanh(x), 1e-10) << x;
  EXPECT_EQ(quick_tanh(std::numeric_limits<double>::infinity()), 1);
  EXPECT_EQ(quick_tanh(-std::numeric_limits<double>::infinity()), -1);
  EXPECT_TRUE(std::isnan(quick_tanh(std::nan(""))));
}

}  // namespace
}  // namespace faultline
