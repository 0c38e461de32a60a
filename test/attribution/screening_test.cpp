// The screening against direct computation: parameters eliminated, the best size, and which sizes are tried.
#include "faultline/attribution/screening.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include <Eigen/QR>

namespace faultline {
namespace {

constexpr Eigen::Index kRows = 40, kParameters = 3, kHypotheses = 2;

struct Problem {
  Eigen::VectorXd r = Eigen::VectorXd::Zero(kRows), z = Eigen::Vector3d(0.3, -1.2, 0.5);
  Eigen::MatrixXd t = Eigen::MatrixXd::Zero(kRows, kParameters), d = Eigen::MatrixXd::Zero(kRows, kHypotheses);
  Problem() {
    for (Eigen::Index i = 0; i < kRows; ++i) {
      const double x = 0.1 * static_cast<double>(i);
      t.row(i) << 1, x, std::sin(3 * x);
      d.row(i) << x * x, std::cos(x);
      r[i] = 2 * std::cos(5 * x) - 1.5 * x * x + 0.7 * x;
    }
  }
  // Least L with hypothesis h at size a, by QR of the stacked rows.
  double loss(Eigen::Index h, double a) const {
    Eigen::MatrixXd j(kRows + kParameters, kParameters);
    Eigen::VectorXd y(kRows + kParameters);
    j << t, Eigen::MatrixXd::Identity(kParameters, kParameters);
    y << r + a * d.col(h), z;
    return (y - j * j.householderQr().solve(y)).squaredNorm();
  }
  Eigen::MatrixXd gram() const {
    Eigen::MatrixXd all(kRows, 1 + kParameters + kHypotheses);
    all << r, t, d;
    Eigen::MatrixXd g = all.transpose() * all;
    g.topLeftCorner(1 + kParameters, 1 + kParameters) += known_to_tolerance(z);
    return g;
  }
};

TEST(Screening, LeavesTheLossWithParametersAtTheirBest) {
  const Problem problem;
  const Eigen::MatrixXd left = without_parameters(problem.gram(), kParameters);
  ASSERT_EQ(left.rows(), 1 + kHypotheses);
  EXPECT_NEAR(left(0, 0), problem.loss(0, 0), 1e-8 * left(0, 0));
  EXPECT_NEAR(least_loss(problem.gram(), kParameters), left(0, 0), 1e-8 * left(0, 0));
  for (Eigen::Index h = 0; h < kHypotheses; ++h)
    EXPECT_NEAR(left(0, 0) + 2 * 0.7 * left(0, 1 + h) + 0.49 * left(1 + h, 1 + h), problem.loss(h, 0.7), 1e-7);
}

TEST(Screening, FindsTheBestSizeWithinItsRange) {
  const Problem problem;
  const Eigen::MatrixXd left = without_parameters(problem.gram(), kParameters);
  for (Eigen::Index h = 0; h < kHypotheses; ++h) {
    const BestSize best = best_size(left, 1 + h, -100, 100);
    EXPECT_NEAR(best.gain, problem.loss(h, 0) - problem.loss(h, best.size), 1e-7);
    for (const double off : {-0.1, 0.1}) EXPECT_GT(problem.loss(h, best.size + off), problem.loss(h, best.size));
    const BestSize held = best_size(left, 1 + h, best.size + 0.2, 100);
    EXPECT_DOUBLE_EQ(held.size, best.size + 0.2);
    EXPECT_NEAR(held.gain, problem.loss(h, 0) - problem.loss(h, held.size), 1e-7);
    EXPECT_EQ(best_size(left, 1 + h, -100, 100, 1.01 * best.information).gain, 0);  // a standstill says nothing
  }
}

TEST(Screening, TriesFurtherSizesOfWhatMayWinOnly) {
  const std::vector<double> losses = {5, 4, 9, 1, 7, 2, 3};
  std::vector<Trial> trials = {{0, true}, {0, false}, {1, true}, {1, false}, {2, true}, {3, false}, {4, false}};
  std::vector<double> limits(losses.size(), -1);
  const auto best = try_sizes(trials, 1, 1, [&](std::size_t i, double enough) {
    limits[i] = enough;
    return losses[i];
  });
  // Hypotheses 1 and 2 come behind 0, which alone is followed; 3 and 4 had no first trial.
  EXPECT_EQ(best, (std::vector<std::size_t>{5, 6, 1, 4, 2}));
  EXPECT_EQ(limits,
            (std::vector<double>{std::numeric_limits<double>::infinity(), 5, std::numeric_limits<double>::infinity(),
                                 -1, std::numeric_limits<double>::infinity(), 5, 5}));
}

}  // namespace
}  // namespace faultline
