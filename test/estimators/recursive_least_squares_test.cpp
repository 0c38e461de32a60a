// Recursive least squares against the normal equations, its bounds, its guard, and the uncertainty it states.
#include "faultline/estimators/recursive_least_squares.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "allocations.h"
#include "faultline/numerics/random.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

using Settings = RecursiveLeastSquaresSettings;

TEST(RecursiveLeastSquares, IsTheWeightedSolutionOfTheNormalEquations) {
  const int n = 3;
  const double g = 0.97;
  RecursiveLeastSquares fit(n, Settings{g, 100, 1e9, 0});
  const double start[n] = {0.5, -1, 2};
  fit.reset(start);
  Random random(3);
  // With a first guess of covariance P0, which is forgotten too.
  Eigen::Matrix3d information = Eigen::Matrix3d::Identity() / 100;
  Eigen::Vector3d sum = information * Eigen::Map<const Eigen::Vector3d>(start);
  for (int k = 0; k < 500; ++k) {
    const Eigen::Vector3d h(random.normal(), random.normal(), 1);
    const double y = h.dot(Eigen::Vector3d(1, 2, 3)) + 0.3 * random.normal();
    ASSERT_TRUE(fit.step(h.data(), y));
    information = g * information + h * h.transpose();
    sum = g * sum + h * y;
    const Eigen::Vector3d exact = information.ldlt().solve(sum);
    for (int i = 0; i < n; ++i) ASSERT_NEAR(fit.parameters()[i], exact[i], 1e-9) << k;
    const Eigen::Matrix3d p = information.inverse();
    // P of the recursion is that of the row still to come: one more forgetting.
    for (int i = 0; i < n; ++i) ASSERT_NEAR(fit.covariance(i, i), p(i, i), 1e-9 * p(i, i)) << k;
  }
}

TEST(RecursiveLeastSquares, FollowsAChangeWithinItsWindow) {
  RecursiveLeastSquares fit(1, Settings{0.99, 10, 100, 0});
  Random random(1);
  const double h = 2;
  for (int k = 0; k < 2000; ++k) fit.step(&h, 3 * h + 0.01 * random.normal());
  EXPECT_NEAR(fit.parameters()[0], 3, 0.003);
  for (int k = 0; k < 100; ++k) fit.step(&h, 4 * h + 0.01 * random.normal());
  EXPECT_NEAR(fit.parameters()[0], 4 - std::pow(0.99, 100), 0.003);  // 1 - g^n of a step
}

TEST(RecursiveLeastSquares, CovarianceIsBoundedHoweverLongTheInputStandsStill) {
  const double limit = 50;
  RecursiveLeastSquares fit(2, Settings{0.95, 1, limit, 0});
  const double still[2] = {1, 1};  // says nothing about the difference of the two
  for (int k = 0; k < 200000; ++k) {
    fit.step(still, 3);
    ASSERT_LE(fit.covariance_trace(), limit * (1 + 1e-12));
    ASSERT_GT(fit.covariance(0, 0), 0);
  }
  EXPECT_NEAR(fit.covariance(0, 0) + fit.covariance(1, 1), fit.covariance_trace(), 1e-9);
  EXPECT_NEAR(fit.parameters()[0] + fit.parameters()[1], 3, 1e-6);
  // And it still learns.
  Random random(2);
  for (int k = 0; k < 2000; ++k) {
    const double h[2] = {random.normal(), random.normal()};
    fit.step(h, 5 * h[0] - h[1]);
  }
  EXPECT_NEAR(fit.parameters()[0], 5, 1e-6);
  EXPECT_NEAR(fit.parameters()[1], -1, 1e-6);
}

TEST(RecursiveLeastSquares, WithoutExcitationNothingChanges) {
  RecursiveLeastSquares fit(1, Settings{0.9, 1, 10, 0.5});
  double h = 1;
  for (int k = 0; k < 50; ++k) fit.step(&h, 2);
  const double value = fit.parameters()[0], p = fit.covariance(0, 0);
  h = 0.49;
  EXPECT_FALSE(fit.step(&h, 100));
  h = std::nan("");
  EXPECT_FALSE(fit.step(&h, 100));
  h = 1;
  EXPECT_FALSE(fit.step(&h, std::nan("")));
  EXPECT_EQ(fit.parameters()[0], value);
  EXPECT_EQ(fit.covariance(0, 0), p);
}

TEST(RecursiveLeastSquares, StatesItsOwnScatter) {
  // 4000 independent estimates: their scatter is what standard_deviation says, and so is the noise.
  Random random(9);
  double squares = 0, stated = 0, noise = 0;
  const int runs = 4000;
  for (int run = 0; run < runs; ++run) {
    RecursiveLeastSquares fit(1, Settings{0.95, 1, 10, 0});
    for (int k = 0; k < 150; ++k) {
      const double h = 3;
      fit.step(&h, 2 * h + 0.2 * random.normal());
    }
    squares += std::pow(fit.parameters()[0] - 2, 2) / runs;
    stated += std::pow(fit.standard_deviation(0), 2) / runs;
    noise += fit.noise_variance() / runs;
  }
  EXPECT_NEAR(std::sqrt(stated) / std::sqrt(squares), 1, 0.05);
  EXPECT_NEAR(noise, 0.04, 0.002);
}

TEST(RecursiveLeastSquares, ResetIsCompleteAndNothingIsAllocated) {
  RecursiveLeastSquares fit(2, Settings{0.95, 1, 10, 0});
  const double start[2] = {1, 2}, h[2] = {1, 0.5};
  const std::uint64_t before = allocations();
  double first = 0;
  for (int pass = 0; pass < 2; ++pass) {
    fit.reset(start);
    for (int k = 0; k < 30; ++k) fit.step(h, 0.1 * k);
    if (pass == 0) first = fit.parameters()[0];
  }
  EXPECT_EQ(fit.parameters()[0], first);
  EXPECT_EQ(allocations() - before, 0u);
}

TEST(RecursiveLeastSquares, RefusesSettingsThatMakeNoSense) {
  EXPECT_THROW(RecursiveLeastSquares(0, Settings{1, 1, 10, 0}), InputError);
  EXPECT_THROW(RecursiveLeastSquares(7, Settings{1, 1, 10, 0}), InputError);
  EXPECT_THROW(RecursiveLeastSquares(1, Settings{0, 1, 10, 0}), InputError);
  EXPECT_THROW(RecursiveLeastSquares(1, Settings{1.01, 1, 10, 0}), InputError);
  EXPECT_THROW(RecursiveLeastSquares(1, Settings{0.9, 0, 10, 0}), InputError);
  EXPECT_THROW(RecursiveLeastSquares(2, Settings{0.9, 6, 10, 0}), InputError);
}

}  // namespace
}  // namespace faultline
