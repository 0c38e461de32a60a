// Correction by one observed state: state, covariance and innovation of the full Kalman formula, the root stays
// triangular.
#include "faultline/estimators/observed_correction.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "faultline/numerics/random.h"

namespace faultline {
namespace {

template <class Matrix>
Matrix filled(Eigen::Index rows, Eigen::Index columns, std::uint64_t seed) {
  Matrix m(rows, columns);
  Random random(seed);
  for (Eigen::Index i = 0; i < rows; ++i)
    for (Eigen::Index j = 0; j < columns; ++j)
      m(i, j) = random.normal() * std::pow(10.0, static_cast<double>(i) * 2 - 4);
  return m;
}

TEST(ObservedCorrection, EqualsTheFullFormula) {
  using Vector = Eigen::Matrix<double, 6, 1>;
  using Root = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;
  for (std::uint64_t seed = 1; seed <= 10; ++seed)
    for (Eigen::Index k = 0; k < 6; ++k) {
      Root root = filled<Root>(6, 6, seed);
      root.triangularView<Eigen::StrictlyUpper>().setZero();
      if (seed == 3 && k > 0) root(k, 0) = 0;
      Vector x = filled<Eigen::Matrix<double, 6, 1>>(6, 1, seed + 50);
      const Eigen::MatrixXd p = root * root.transpose();
      const double r = 0.3 * p(k, k), y = x[k] + 0.7 * std::sqrt(p(k, k));
      const Eigen::VectorXd gain = p.col(k) / (p(k, k) + r);
      const Eigen::VectorXd expected = x + gain * (y - x[k]);
      const Eigen::MatrixXd expected_p = p - gain * p.row(k);
      const double nis = correct_observed_state(x, root, k, y, r);
      EXPECT_NEAR(nis, 0.49 / 1.3, 1e-12);
      for (Eigen::Index i = 0; i < 6; ++i) {
        EXPECT_NEAR(x[i], expected[i], 1e-12 * std::sqrt(p(i, i)));
        for (Eigen::Index j = 0; j < 6; ++j) {
          EXPECT_NEAR(root.row(i).dot(root.row(j)), expected_p(i, j), 1e-12 * std::sqrt(p(i, i) * p(j, j)));
          if (j > i) {
            EXPECT_EQ(root(i, j), 0);
          }
        }
      }
    }
}

}  // namespace
}  // namespace faultline
