#include "faultline/rig/orifice.h"

#include <gtest/gtest.h>

namespace faultline {
namespace {

TEST(Orifice, RootAndSlopeAreThoseOfTheFormula) {
  constexpr double kTransition = 100;
  const auto formula = [](double drop) { return drop / std::pow(drop * drop + kTransition * kTransition, 0.25); };
  for (const double size : {0.0, 1.0, 99.0, 9999.0, 10001.0, 3e4, 1e7})
    for (const double drop : {size, -size}) {
      const auto [root, slope] = signed_root_and_slope(drop, kTransition);
      const double step = 1e-3 * std::max(std::abs(drop), kTransition);
      const double expected =
          (formula(drop - 2 * step) - 8 * formula(drop - step) + 8 * formula(drop + step) - formula(drop + 2 * step)) /
          (12 * step);
      EXPECT_NEAR(root, formula(drop), 1e-12 * std::abs(formula(drop))) << drop;
      EXPECT_NEAR(signed_root(drop, kTransition), root, 1e-12 * std::abs(root)) << drop;
      EXPECT_NEAR(slope, expected, 1e-9 * expected) << drop;
    }
}

}  // namespace
}  // namespace faultline
