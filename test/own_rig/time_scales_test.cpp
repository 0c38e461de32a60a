// Time scales against those that can be written down: tanks have 2 A h/q each, the valve a damped pair of poles.
#include <cmath>

#include <gtest/gtest.h>

#include "faultline/rig/time_scales.h"
#include "own_rigs.h"

namespace faultline {
namespace {

TEST(TimeScales, TanksByTheirLevels) {
  const Datasheet sheet = own_rig("two_tanks");
  const StepTest test = step_test(sheet);
  // 2 A h/q with h = (q/a)^2/2g: proportional to the flow; levels 0.1 to 0.9 of the pump have 0.2 to 1.8 times that at
  // half.
  const double at_half = 0.012 * 8e-6 * 5 / (2.4e-5 * 2.4e-5 * 9.81);
  EXPECT_GT(test.scales.slowest_s, 0.5 * at_half);
  EXPECT_LT(test.scales.slowest_s, 1.5 * at_half);
  EXPECT_LE(test.scales.fastest_s, test.scales.slowest_s);
  EXPECT_GE(test.scales.fastest_s, sheet.sample_period);
  EXPECT_EQ(test.scales.integrators, 0);
  // Two equal lags in a row come within 5 % after 4.74 of their time constants, one after 3.
  EXPECT_GT(test.scales.settling_s, 3 * test.scales.slowest_s);
  EXPECT_LT(test.scales.settling_s, 8 * test.scales.slowest_s);
  // (8e-6 * 9/2.4e-5)^2/2g = 0.46 m at 9 V: beyond the transducer, which ends at 0.4 m; 8 V stay below.
  EXPECT_DOUBLE_EQ(test.low_fraction, 0.1);
  EXPECT_DOUBLE_EQ(test.high_fraction, 0.8);
  EXPECT_NEAR(test.highest[0], 0.4587, 0.02);
  EXPECT_GT(test.points.size(), 20u);
}

TEST(TimeScales, ValveByItsPoles) {
  const StepTest test = step_test(own_rig("fast_valve"));
  EXPECT_NEAR(test.scales.fastest_s, 1 / 1500.0, 0.2 / 1500);  // of |lambda| = w, where the chamber is not faster
  EXPECT_GT(test.scales.slowest_s, 1 / 1050.0 * 0.9);          // 1/(z w)
  EXPECT_LT(test.scales.slowest_s, 0.05);
}

TEST(TimeScales, AChainIsSlowerThanItsModes) {
  const StepTest test = step_test(own_rig("long_chain"));
  EXPECT_NEAR(test.scales.slowest_s, 0.5, 0.25);
  // Twenty lags of 0.5 s: (10 + 1.645 root(20) 0.5) s where the sum of exponentials is taken for normal.
  EXPECT_NEAR(test.scales.settling_s, 13.7, 1.5);
}

// The chamber follows a step of the coil within few samples; a tank's level never bends.
TEST(TimeScales, HowLongTheModelsOwnMotionLooksLikeNoise) {
  const Datasheet tanks = own_rig("two_tanks"), valve = own_rig("fast_valve");
  const StepTest slow = step_test(tanks), fast = step_test(valve);
  ASSERT_EQ(slow.bends.size(), tanks.channels.size());
  const Bends& level = slow.bends[static_cast<std::size_t>(tanks.channel("lower_level"))];
  EXPECT_EQ(level.noise, 1);
  EXPECT_EQ(level.samples, 0);
  for (const Bends& bends : fast.bends) {
    EXPECT_GE(bends.noise, 1);
    EXPECT_LE(bends.samples, 50);
  }
}

TEST(TimeScales, RigWithoutEquations) {
  Datasheet sheet = own_rig("two_tanks");
  sheet.rig = "steam_engine";
  EXPECT_THROW(time_scales(sheet), std::exception);
}

}  // namespace
}  // namespace faultline
