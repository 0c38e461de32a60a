// Run lengths and thresholds against published tables, closed forms and simulation.
#include "faultline/detectors/run_length.h"

#include <gtest/gtest.h>

#include <cmath>

#include "faultline/detectors/cusum.h"
#include "faultline/numerics/random.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

TEST(RunLength, IsThatOfThePublishedTable) {
  // Two-sided, k = 0.5: Montgomery, Introduction to Statistical Quality Control, table of Hawkins (1993).
  EXPECT_NEAR(two_sided_run_length(0.5, 4, 0), 168, 0.5);
  EXPECT_NEAR(two_sided_run_length(0.5, 5, 0), 465, 1);
  EXPECT_NEAR(two_sided_run_length(0.5, 4, 1), 8.38, 0.01);
  EXPECT_NEAR(two_sided_run_length(0.5, 5, 1), 10.4, 0.05);
  EXPECT_NEAR(two_sided_run_length(0.5, 5, 0.5), 38.0, 0.1);
  // h = 0: the first sample above k ends it.
  EXPECT_NEAR(cusum_run_length(1, 1e-9, 0), 1 / (0.5 * std::erfc(1 / std::sqrt(2.0))), 1e-6);
}

TEST(RunLength, IsWhatTheTestDoes) {
  Random random(7);
  double total = 0;
  const int runs = 4000;
  for (int run = 0; run < runs; ++run) {
    TwoSidedCusum test;
    test.allowance = 0.4;
    test.threshold = 3.5;
    int k = 1;
    while (!test.update(random.normal())) ++k;
    total += k;
  }
  const double expected = two_sided_run_length(0.4, 3.5, 0);
  EXPECT_NEAR(total / runs / expected, 1, 4 / std::sqrt(runs));  // run lengths scatter like their mean
}

TEST(RunLength, ThresholdGivesTheRateAskedFor) {
  for (const double k : {0.1, 0.3, 0.5, 1.0})
    for (const double samples : {1e3, 3.6e6, 3.6e8}) {
      const double h = cusum_threshold(k, samples);
      EXPECT_NEAR(two_sided_run_length(k, h, 0) / samples, 1, 1e-3) << k << " " << samples;
      EXPECT_NEAR(siegmund_threshold(k, samples) / h, 1, 0.03) << k << " " << samples;
    }
  EXPECT_THROW(cusum_threshold(0, 1e6), InputError);
  EXPECT_THROW(cusum_threshold(0.5, 0.5), InputError);
}

TEST(Cusum, BothSidesAndTheBeginning) {
  TwoSidedCusum test;
  test.allowance = 0.5;
  test.threshold = 2;
  for (int k = 0; k < 10; ++k) EXPECT_FALSE(test.update(0.4));  // below delta/2
  EXPECT_FALSE(test.update(1.5));
  EXPECT_FALSE(test.update(1.5));
  EXPECT_TRUE(test.update(1.5));
  EXPECT_EQ(test.steps(), 3u);
  for (int k = 0; k < 1000; ++k) test.update(100);
  EXPECT_LE(test.up, 4);  // stops at twice the threshold, so that it comes back
  int back = 0;
  while (test.update(0)) ++back;
  EXPECT_LE(back, 4);
  test.reset();
  for (int k = 0; k < 3; ++k) test.update(-1.5);
  EXPECT_GT(test.down, 2);
  EXPECT_EQ(test.up, 0);
}

}  // namespace
}  // namespace faultline
