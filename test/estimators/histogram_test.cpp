// The multi-variable histogram by itself: limits against known distributions, integer against floating arithmetic,
// forgetting, range finding, memory.
#include "faultline/estimators/histogram.h"

#include <gtest/gtest.h>

#include "allocations.h"
#include "faultline/numerics/random.h"

namespace faultline {
namespace {

using Floating = Histogram<FloatingArithmetic>;
using Integer = Histogram<IntegerArithmetic>;

HistogramShape one_bin() {
  HistogramShape shape;
  shape.sections = 64;
  shape.minimum = 100;
  shape.memory = 60000;
  return shape;
}

TEST(Histogram, LimitsCoverTheSharesOfAKnownDistribution) {
  Floating normal(one_bin()), skewed(one_bin());
  Random random(1);
  for (int k = 0; k < 50000; ++k) {
    normal.learn(0, 30000 + 500 * random.normal());
    skewed.learn(0, 1000 - 400 * std::log(1 - random.uniform()));  // exponential
  }
  const auto& n = normal.bins()[0];
  const double section = std::ldexp(1.0, n.shift);
  EXPECT_LT(section, 0.25 * 500);
  EXPECT_NEAR(n.mean, 30000, 20);
  EXPECT_NEAR(n.high, 30000 + 1.645 * 500, 25);  // 5 % of all above
  EXPECT_NEAR(n.low, 30000 - 1.645 * 500, 25);
  // Of the exponential, 1 - 1/e lies below the mean; 90 % of that above the low limit.
  const double below = 1 - std::exp(-1.0);
  const auto& s = skewed.bins()[0];
  EXPECT_NEAR(s.mean, 1400, 15);
  EXPECT_NEAR(s.low, 1000 - 400 * std::log(1 - 0.1 * below), 20);
  EXPECT_NEAR(s.high, 1000 - 400 * std::log(0.1 * (1 - below)), 60);
}

TEST(Histogram, EveryBinLearnsItsOwn) {
  HistogramShape shape = one_bin();
  shape.bins[0] = 4;
  shape.bins[1] = 3;
  Floating h(shape);
  Random random(2);
  const auto bin = [&](int i, int k) {
    const double point[2] = {(i + 0.5) * kExplanatoryQuanta / 4, (k + 0.5) * kExplanatoryQuanta / 3};
    return h.bin_of(point);
  };
  for (int round = 0; round < 500; ++round)
    for (int i = 0; i < 4; ++i)
      for (int k = 0; k < 3; ++k) h.learn(bin(i, k), 10000 * i + 1000 * k + 20 * random.normal());
  for (int i = 0; i < 4; ++i)
    for (int k = 0; k < 3; ++k) {
      EXPECT_EQ(bin(i, k), static_cast<std::size_t>(3 * i + k));
      EXPECT_NEAR(h.bins()[bin(i, k)].mean, 10000 * i + 1000 * k, 5);
    }
  const double beyond[2] = {1e6, -1e6};
  EXPECT_EQ(h.bin_of(beyond), 9u);
}

TEST(Histogram, JudgesOnlyBinsOfEnoughSamples) {
  Floating h(one_bin());
  for (int k = 0; k < 99; ++k) {
    h.learn(0, 100 + k % 5);
    EXPECT_FALSE(h.judge(0, 5000));
  }
  EXPECT_EQ(h.average(), 0.5);
  h.learn(0, 100);
  EXPECT_TRUE(h.judge(0, 5000));
  EXPECT_GT(h.average(), 0.5);
}

TEST(Histogram, AverageIsScaledByTheLimits) {
  HistogramShape shape = one_bin();
  shape.average_shift = 4;
  shape.window_shift = 8;
  Floating h(shape);
  Random random(3);
  for (int k = 0; k < 20000; ++k) h.learn(0, 5000 + 100 * random.normal());
  const auto bin = h.bins()[0];
  const auto hold = [&](double q) {
    for (int k = 0; k < 4096; ++k) h.judge(0, q);
    return h.average();
  };
  EXPECT_NEAR(hold(bin.mean), 0.5, 1e-9);
  EXPECT_NEAR(h.above(), 0, 1e-6);
  hold(0.6 * bin.mean + 0.4 * bin.high);
  EXPECT_NEAR(h.level(), 0.7, 1e-6);
  EXPECT_NEAR(hold(bin.high), 1, 1e-9);
  EXPECT_NEAR(hold(bin.low), 0, 1e-9);
  EXPECT_NEAR(hold(bin.mean + 3 * (bin.high - bin.mean)), 2, 1e-9);
  EXPECT_NEAR(h.above(), 1, 1e-6);
  EXPECT_NEAR(h.level(), 1, 1e-6);  // cut
  EXPECT_NEAR(hold(bin.low - 1), -0.5 / (bin.mean - bin.low), 1e-9);
  EXPECT_NEAR(h.level(), 0, 1e-6);
  EXPECT_NEAR(h.below(), 1, 1e-6);
  EXPECT_NEAR(h.above(), 0, 1e-6);
  // The window forgets by 1 - 2^-8 a sample.
  h.restart();
  EXPECT_EQ(h.level(), 0.5);
  for (int k = 0; k < 200; ++k) h.judge(0, bin.high + 1000);
  EXPECT_NEAR(h.above(), 1 - std::pow(1 - 1.0 / 256, 199), 0.01);
}

// Both arithmetics over the same samples: autocorrelated and stepping, with outliers, over many halvings.
TEST(Histogram, IntegersAnswerAsFloatingNumbersWithinASection) {
  HistogramShape shape;
  shape.bins[0] = 8;
  shape.bins[1] = 8;
  shape.minimum = 50;
  shape.memory = 1000;
  shape.average_shift = 3;
  shape.window_shift = 10;
  Floating f(shape);
  Integer n(shape);
  Random random(4);
  double x = 0, point[2] = {0, 0};
  std::int32_t whole[2];
  double worst_limit = 0, worst_average = 0, worst_share = 0, worst_level = 0;
  for (int k = 0; k < 400000; ++k) {
    if (k % 200 == 0) {
      point[0] = std::floor(random.uniform(0, kExplanatoryQuanta));
      point[1] = std::floor(random.uniform(0, kExplanatoryQuanta));
    }
    x += 0.05 * (random.normal() - x);
    const double q =
        20000 + 0.2 * point[0] + 0.1 * point[1] + 900 * x + 40 * random.normal() + (k % 997 == 0 ? 9000 : 0);
    const auto whole_q = static_cast<std::int32_t>(std::floor(q + 0.5));
    for (int i = 0; i < 2; ++i) whole[i] = static_cast<std::int32_t>(point[i]);
    const std::size_t bin = f.bin_of(point);
    ASSERT_EQ(n.bin_of(whole), bin);
    ASSERT_EQ(f.judge(bin, q), n.judge(bin, whole_q)) << k;
    f.learn(bin, q);
    n.learn(bin, whole_q);
    const auto& a = f.bins()[bin];
    const auto& b = n.bins()[bin];
    ASSERT_EQ(a.shift, b.shift) << k;
    ASSERT_EQ(a.first, b.first) << k;
    if (!f.ready(bin)) continue;
    const double section = std::ldexp(1.0, std::max(a.shift, b.shift));
    for (const double difference : {a.mean - b.mean, a.low - b.low, a.high - b.high})
      worst_limit = std::max(worst_limit, std::abs(difference) / section);
    worst_average = std::max(worst_average, std::abs(f.average() - n.average()));
    worst_level = std::max(worst_level, std::abs(f.level() - n.level()));
    worst_share = std::max({worst_share, std::abs(f.above() - n.above()), std::abs(f.below() - n.below())});
  }
  EXPECT_LT(worst_limit, 0.1);
  EXPECT_LT(worst_average, 0.02);
  EXPECT_LT(worst_share, 0.01);
  EXPECT_LT(worst_level, 0.01);
}

TEST(Histogram, ForgetsWithItsMemory) {
  HistogramShape shape = one_bin();
  shape.memory = 2000;
  Integer h(shape);
  Random random(5);
  const auto learn = [&](double level, int count) {
    for (int k = 0; k < count; ++k) h.learn(0, static_cast<std::int32_t>(level + 50 * random.normal()));
  };
  learn(10000, 20000);
  EXPECT_NEAR(h.bins()[0].mean, 10000, 10);
  EXPECT_LT(h.bins()[0].population, 2000);
  EXPECT_GE(h.bins()[0].population, 999);
  learn(12000, 10000);  // ten halvings: a thousandth is left
  EXPECT_NEAR(h.bins()[0].mean, 12000, 20);
  EXPECT_GT(h.bins()[0].low, 11000);
}

TEST(Histogram, HalvingKeepsTheSumsUpToEverySection) {
  HistogramShape shape = one_bin();
  shape.sections = 8;
  shape.memory = 200;
  Integer h(shape);
  const double counts[8] = {1, 3, 5, 101, 77, 9, 2, 1};  // 199
  ASSERT_TRUE(h.restore(0, 100, 2, counts));
  h.learn(0, 4 * 103);  // the 200th
  double sum = 0, left = 0;
  for (int i = 0; i < 8; ++i) {
    sum += counts[i] + (i == 3);
    left += h.counts(0)[i];
    EXPECT_EQ(left, std::floor(sum / 2)) << i;
  }
  EXPECT_EQ(h.bins()[0].population, 100);
}

// A bin is first met while the rig moves through it, over 400 times the width at which it settles.
TEST(Histogram, AFirstVisitDoesNotCoarsenItForGood) {
  const auto learns = [](auto h) {
    Random random(8);
    for (int k = 0; k < 200; ++k) h.learn(0, static_cast<decltype(h.bins()[0].mean)>(100 * k));
    for (int k = 0; k < 20000; ++k)
      h.learn(0, static_cast<decltype(h.bins()[0].mean)>(std::floor(10000 + 50 * random.normal())));
    // The quantiles of 5 and 95 %, as the normal distribution has them.
    EXPECT_LE(h.bins()[0].shift, 5);
    EXPECT_NEAR(h.bins()[0].mean, 10000, 10);
    EXPECT_NEAR(h.bins()[0].high - h.bins()[0].mean, 82, 20);
    EXPECT_NEAR(h.bins()[0].mean - h.bins()[0].low, 82, 20);
  };
  HistogramShape shape;
  shape.memory = 4096;
  learns(Histogram<FloatingArithmetic>(shape));
  learns(Histogram<IntegerArithmetic>(shape));
}

TEST(Histogram, OutliersDoNotCoarsenIt) {
  Integer h(one_bin());
  Random random(6);
  for (int k = 0; k < 20000; ++k)
    h.learn(0, k % 100 == 99 ? 60000 : static_cast<std::int32_t>(1000 + 20 * random.normal()));
  const auto& bin = h.bins()[0];
  EXPECT_LE(1 << bin.shift, 8);
  EXPECT_NEAR(bin.low, 1000 - 1.645 * 20, 8);
  EXPECT_NEAR(bin.high, 1000 + 1.645 * 20, 8);
}

// What counted as outliers before the range was widened stays where it was counted: a tenth of the step at most.
TEST(Histogram, AStepIsFollowedHoweverFar) {
  for (const double to : {0.0, 65535.0, 30100.0}) {
    Floating h(one_bin());
    for (int k = 0; k < 5000; ++k) h.learn(0, 30000 + k % 7);
    for (int k = 0; k < 20000; ++k) h.learn(0, to);
    const auto& bin = h.bins()[0];
    EXPECT_NEAR(bin.mean, (5000 * 30003 + 20000 * to) / 25000, 5 + 0.11 * std::abs(to - 30003)) << to;
    EXPECT_LE(bin.low, bin.mean);
    EXPECT_NEAR(to < 30003 ? bin.low : bin.high, to, 5 + std::ldexp(1.0, bin.shift)) << to;
  }
}

TEST(Histogram, AStepAllocatesNothing) {
  HistogramShape shape = one_bin();
  shape.bins[0] = 8;
  Floating f(shape);
  Integer n(shape);
  Random random(7);
  const std::uint64_t before = allocations();
  for (int k = 0; k < 50000; ++k) {
    const std::size_t bin = static_cast<std::size_t>(k) / 100 % 8;
    const double q = 20000 + 3000 * random.normal();
    f.judge(bin, q);
    f.learn(bin, q);
    n.judge(bin, static_cast<std::int32_t>(q));
    n.learn(bin, static_cast<std::int32_t>(q));
  }
  EXPECT_EQ(allocations() - before, 0u);
  // 8 bins of 64 16-bit counts and 20 bytes each, and what they share.
  EXPECT_LE(n.bytes(), 8 * (2 * 64 + 24) + 200u);
}

TEST(Histogram, WhatIsNoHistogramIsRefused) {
  Integer h(one_bin());
  std::vector<double> counts(64, 10);
  EXPECT_TRUE(h.restore(0, 100, 3, counts.data()));
  EXPECT_TRUE(h.ready(0));
  EXPECT_FALSE(h.restore(0, 100, -1, counts.data()));
  EXPECT_FALSE(h.restore(0, 100, 30, counts.data()));
  counts[5] = -1;
  EXPECT_FALSE(h.restore(0, 100, 3, counts.data()));
  counts[5] = 1e9;
  EXPECT_FALSE(h.restore(0, 100, 3, counts.data()));
}

}  // namespace
}  // namespace faultline
