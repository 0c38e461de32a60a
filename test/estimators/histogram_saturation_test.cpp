// When a drifting variable reaches an end: courses of known shape, the interval's coverage, nothing in sight without a
// drift, fixed memory, and operating points that are nearer to the end than others.
#include "faultline/estimators/histogram_saturation.h"

#include <gtest/gtest.h>

#include <cmath>

#include "allocations.h"
#include "faultline/numerics/random.h"

namespace faultline {
namespace {

TEST(DriftCourse, APlainLineIsFollowedToItsLevel) {
  DriftCourse course;
  for (int k = 0; k < 20; ++k) course.add(10 * k + 5, 0.5 + 0.01 * 10 * k, 0, 1e6);
  // 2.4 in the middle of the last block, 5 s ago, 0.01 a second: 4 is 155 s away, 145 s when 10 s have passed.
  const Crossing c = course.reaches(4, 0, 200);
  EXPECT_NEAR(c.value, 155, 1e-3);
  EXPECT_NEAR(c.after(10).value, 145, 1e-3);
  EXPECT_NEAR(c.low, 155, 0.1);
  EXPECT_NEAR(c.high, 155, 0.1);
  EXPECT_EQ(course.reaches(2, 0, 200).value, 0);
  EXPECT_EQ(course.reaches(2, 0, 200).high, 0);
  EXPECT_EQ(Crossing().after(10).value, kNever);
}

// Drifts that begin at 600 s, grow slower or faster than a line, reach the end after 1500 to 4000 s and are asked for
// when 30 to 90 % of that have passed, at blocks whose scatter is correlated with the one before or not. Larger where
// the end is: blocks lie at z 0.2 and 0.4.
TEST(DriftCourse, TheIntervalHoldsTheTruthOfEveryShape) {
  for (const double power : {0.5, 0.7, 1.0, 1.5, 2.0, 3.0})
    for (const double correlation : {0.0, 0.5}) {
      Random random(3);
      int held = 0, told = 0, above = 0;
      for (int n = 0; n < 150; ++n) {
        const double end = random.uniform(1500, 4000), now = 600 + random.uniform(0.3, 0.9) * end;
        DriftCourse course;
        double off = 0;
        for (int k = 0; 60 * k + 60 < now; ++k) {
          const double t = std::max(0.0, 60 * k + 30 - 600.0) / end, z = k % 2 == 0 ? 0.2 : 0.4;
          off = correlation * off + std::sqrt(1 - correlation * correlation) * 0.3 * random.normal();
          course.add(60 * k + 30, 6 * std::pow(t, power) * (1 - 0.5 * z) + off, z, 2400);
        }
        const Crossing c = course.reaches(6, 0, now);
        if (c.value >= kNever) continue;
        ++told;
        const double truth = 600 + end - now;
        held += c.low <= truth && truth <= c.high;
        above += c.high < kNever;
      }
      EXPECT_GT(told, 80) << power;
      EXPECT_GE(held / static_cast<double>(told), 0.8) << power << " " << correlation;
      EXPECT_LE(held / static_cast<double>(told), 0.98) << power << " " << correlation;
      EXPECT_GT(above / static_cast<double>(told), 0.5)
          << power << " " << correlation;  // an interval without an end says little
    }
}

// A straight drift whose rate falls to 0.4, or grows 2.5-fold, at 900 to 1500 s, asked for ten blocks later.
TEST(DriftCourse, TheIntervalHoldsTheTruthWhenTheRateChanged) {
  for (const double change : {0.4, 2.5}) {
    Random random(5);
    int held = 0, told = 0;
    for (int n = 0; n < 150; ++n) {
      const double bend = random.uniform(900, 1500), now = bend + 600, end = now + random.uniform(300, 1200);
      const auto course_at = [&](double t) { return std::max(0.0, t - 600) + (change - 1) * std::max(0.0, t - bend); };
      DriftCourse course;
      for (int k = 0; 60 * k + 60 < now; ++k)
        course.add(60 * k + 30, 6 * course_at(60 * k + 30) / course_at(end) + 0.2 * random.normal(),
                   0.2 + 0.2 * (k % 2), 2400);
      const Crossing c = course.reaches(6, 0, now);
      if (c.value >= kNever) continue;
      ++told;
      held += c.low <= end - now && end - now <= c.high;
    }
    EXPECT_GT(told, 100) << change;
    EXPECT_GE(held / static_cast<double>(told), 0.85) << change;
  }
}

// What is left is known to +-1: the course is told as without that, the interval reaches as far as 1 more or less.
TEST(DriftCourse, ADoubtfulEndWidensTheInterval) {
  DriftCourse course;
  for (int k = 0; k < 20; ++k) course.add(10 * k + 5, 0.01 * 10 * k, 0, 1e6);
  const Crossing c = course.reaches(4, 1, 200);
  EXPECT_NEAR(c.value, 205, 0.1);
  EXPECT_NEAR(c.low, 105, 0.1);
  EXPECT_NEAR(c.high, 305, 0.1);
}

TEST(DriftCourse, NothingIsInSightWithoutADrift) {
  Random random(4);
  int seen = 0;
  constexpr int kCourses = 400;
  for (int n = 0; n < kCourses; ++n) {
    DriftCourse course;
    for (int k = 0; k < 40; ++k) course.add(60 * k + 30, 0.2 * random.normal(), 0.2 * (k % 3), 3600);
    const Crossing c = course.reaches(6, 0, 2400);
    seen += c.value < kNever;
    EXPECT_LE(c.low, c.value);
    EXPECT_LE(c.value, c.high);
  }
  EXPECT_LT(seen / double{kCourses}, 0.05);
  EXPECT_EQ(DriftCourse().reaches(1, 0, 0).low, kNever);
}

TEST(DriftCourse, WhatWasBeforeTheHorizonIsForgotten) {
  DriftCourse course;
  for (int k = 0; k < 100; ++k) course.add(60 * k, 20 - 0.001 * 60 * k, 0, 3600);
  for (int k = 0; k < 200; ++k) course.add(6000 + 60 * k, 0.001 * 60 * k, 0, 3600);
  EXPECT_NEAR(course.reaches(20, 0, 18000).value, (20 - 0.06 * 200) / 0.001, 60);
}

// A week of blocks: they grow, and the course stays what it is.
TEST(DriftCourse, MemoryIsFixed) {
  DriftCourse course;
  const std::uint64_t before = allocations();
  for (int k = 0; k < 10000; ++k) course.add(60 * k, 0.0001 * k, k % 2 == 0 ? 0.1 : 0.4, 1e9);
  const Crossing c = course.reaches(2, 0, 600000);
  EXPECT_EQ(allocations() - before, 0u);
  EXPECT_NEAR(c.value, 600000, 2000);
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
  EXPECT_NEAR(watch.crossing().value, 5000 - time, 100);  // a course that bends is not quite excluded
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
