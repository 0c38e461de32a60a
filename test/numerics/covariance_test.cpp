// The steps of a Kalman filter's covariance against the plain equations, for sizes around whole vectors.
#include "faultline/numerics/covariance.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "faultline/numerics/random.h"

namespace faultline {
namespace {

Eigen::MatrixXd random_matrix(Eigen::Index rows, Eigen::Index columns, Random& random) {
  Eigen::MatrixXd result(rows, columns);
  for (double& value : result.reshaped()) value = random.normal();
  return result;
}

TEST(Covariance, GoesByTheEquations) {
  for (Eigen::Index n = 1; n <= 33; ++n) {
    Random random(static_cast<std::uint64_t>(n));
    Covariance covariance(Eigen::VectorXd::LinSpaced(n, 1, 2));
    Eigen::MatrixXd expected = Eigen::VectorXd::LinSpaced(n, 1, 2).asDiagonal();
    for (int step = 0; step < 5; ++step) {
      const Eigen::MatrixXd f = random_matrix(n, n, random) / std::sqrt(static_cast<double>(n));
      covariance.propagate(f);
      covariance.variances().array() += 0.1;
      expected = f * expected * f.transpose();
      expected.diagonal().array() += 0.1;
      for (int reading = 0; reading < 3; ++reading) {
        Eigen::VectorXd h = random_matrix(n, 1, random);
        h[reading % n] = 0;
        const double variance = h.dot(expected * h) + 1;
        const Eigen::VectorXd gain = expected * h / variance;
        expected -= variance * gain * gain.transpose();
        EXPECT_NEAR(covariance.take(h), variance, 1e-9 * variance) << n;
        EXPECT_LT((covariance.gain() - gain).cwiseAbs().maxCoeff(), 1e-12) << n;
      }
      EXPECT_LT((covariance.matrix() - expected).cwiseAbs().maxCoeff(), 1e-11) << n;
    }
  }
}

// Readings that are far better than what was known, and a state that none of them shows.
TEST(Covariance, StaysPositive) {
  constexpr Eigen::Index kStates = 6;
  Random random(7);
  Covariance covariance(Eigen::VectorXd::Ones(kStates));
  Eigen::MatrixXd f = Eigen::MatrixXd::Identity(kStates, kStates);
  f.diagonal(1).setConstant(0.1);
  Eigen::VectorXd h = Eigen::VectorXd::Zero(kStates);
  for (int step = 0; step < 2000; ++step) {
    covariance.propagate(f);
    covariance.variances().array() += 1e-12;
    h[1] = 1e4;
    h[4] = 1e4 * random.normal();
    covariance.take(h);
    const Eigen::MatrixXd p = covariance.matrix();
    EXPECT_LT((p - p.transpose()).cwiseAbs().maxCoeff(), 1e-12) << step;
    if (step % 100 == 0) {
      EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(p).eigenvalues().minCoeff(), 0) << step;
    }
  }
}

}  // namespace
}  // namespace faultline
