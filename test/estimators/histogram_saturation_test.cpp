// When a drifting variable reaches an end: lines of known slope, the interval's coverage, nothing in sight without a
// drift, and operating points that are nearer to the end than others.
#include "faultline/estimators/histogram_saturation.h"

#include <gtest/gtest.h>

#include <cmath>

#include "allocations.h"
#include "faultline/numerics/random.h"

namespace faultline {
namespace {

TEST(DriftLine, APlainLineIsFollowedToItsLevel) {
  DriftLine line;
  for (int k = 0; k < 20; ++k) line.add(10, 0.5 + 0.01 * 10 * k, 1e6);
  // 0.5 + 1.9 by now, 0.01 a second: 4 is 160 s away, 150 s when 10 s have passed.
  EXPECT_NEAR(line.reaches(4, 0).value, 160, 1e-6);
  EXPECT_NEAR(line.reaches(4, 10).value, 150, 1e-6);
  EXPECT_NEAR(line.reaches(4, 0).low, 160, 0.1);
  EXPECT_NEAR(line.reaches(4, 0).high, 160, 0.1);
  EXPECT_EQ(line.reaches(2, 0).value, 0);
  EXPECT_EQ(line.reaches(2, 0).high, 0);
}

TEST(DriftLine, TheIntervalHoldsTheTruthNineTimesInTen) {
  Random random(3);
  int held = 0, below = 0;
  constexpr int kLines = 2000;
  for (int n = 0; n < kLines; ++n) {
    DriftLine line;
    for (int k = 0; k < 24; ++k) line.add(60, 0.002 * 60 * k + 0.2 * random.normal(), 1e9);
    const Crossing c = line.reaches(6, 0);  // 0.002 a second: at 3000 s, the last block is at 1380 s
    held += c.low <= 1620 && 1620 <= c.high;
    below += c.value < 1620;
  }
  EXPECT_NEAR(held / double{kLines}, 0.9, 0.03);
  EXPECT_NEAR(below / double{kLines}, 0.5, 0.06);
}

TEST(DriftLine, NothingIsInSightWithoutADrift) {
  Random random(4);
  int seen = 0;
  constexpr int kLines = 1000;
  for (int n = 0; n < kLines; ++n) {
    DriftLine line;
    for (int k = 0; k < 40; ++k) line.add(60, 0.2 * random.normal(), 3600);
    const Crossing c = line.reaches(6, 0);
    seen += c.value < kNever;
    EXPECT_GT(c.low, 3600);
    EXPECT_LE(c.low, c.value);
    EXPECT_LE(c.value, c.high);
  }
  EXPECT_LT(seen / double{kLines}, 0.07);  // one side of a two-sided 90 %
  EXPECT_EQ(DriftLine().reaches(1, 0).low, kNever);
}

TEST(DriftLine, WhatWasBeforeTheHorizonIsForgotten) {
  DriftLine line;
  for (int k = 0; k < 100; ++k) line.add(60, 0, 1200);
  for (int k = 0; k < 200; ++k) line.add(60, 0.001 * 60 * k, 1200);
  EXPECT_NEAR(line.reaches(20, 0).value, (20 - 0.06 * 199) / 0.001, 60);
}

TEST(SaturationWatch, TheNearestOperatingPointsDecide) {
  // Bins at 1, 5 and 9 of 0..10, each +-0.5; the last drifts by 0.001 a second, the others do not.
  SaturationWatch watch(3, 0, 10, 6, 1e6);
  for (const double at : {1.0, 5.0, 9.0}) watch.anchor(static_cast<std::size_t>(at / 4), at, at - 0.5, at + 0.5);
  double time = 0;
  const std::uint64_t before = allocations();
  for (int k = 0; k < 1800; ++k, time += 1) {
    watch.pass(1);
    const std::size_t b = (static_cast<std::size_t>(k) / 6) % 3;
    watch.add(b, 1 + 4.0 * static_cast<double>(b) + (b == 2 ? 1e-4 * time : 0));
  }
  EXPECT_EQ(allocations() - before, 0u);
  // Its high limit is 9.5: 0.5 more is reached 5000 s from the start.
  EXPECT_NEAR(watch.crossing().value, 5000 - time, 30);
  watch.restart();
  EXPECT_EQ(watch.crossing().value, kNever);
}

TEST(SaturationWatch, TheLowEndCountsToo) {
  SaturationWatch watch(1, 0, 10, 10, 1e6);
  watch.anchor(0, 3, 2.5, 3.5);
  for (int k = 0; k < 1000; ++k) {
    watch.pass(1);
    watch.add(0, 3 - 0.001 * k);
  }
  EXPECT_NEAR(watch.crossing().value, 2500 - 1000, 10);
}

}  // namespace
}  // namespace faultline
