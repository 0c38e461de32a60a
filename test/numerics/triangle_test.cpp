// reduce_to_triangle, reduce_beside_diagonal: lower triangular, the same M M', of fixed and free size, with rows of
// nothing and of bad scaling.
#include "faultline/numerics/triangle.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "faultline/numerics/random.h"

namespace faultline {
namespace {

template <class Matrix>
void check(Matrix m, bool beside_diagonal = false) {
  const Eigen::MatrixXd before = m * m.transpose();
  if (beside_diagonal)
    reduce_beside_diagonal(m);
  else
    reduce_to_triangle(m);
  const Eigen::MatrixXd after = m * m.transpose();
  for (Eigen::Index i = 0; i < m.rows(); ++i) {
    for (Eigen::Index j = i + 1; j < m.cols(); ++j) EXPECT_EQ(m(i, j), 0) << i << "," << j;
    for (Eigen::Index j = 0; j < m.rows(); ++j)
      EXPECT_NEAR(after(i, j), before(i, j), 1e-13 * std::sqrt(before(i, i) * before(j, j)) + 1e-300) << i << "," << j;
  }
}

template <class Matrix>
Matrix filled(Eigen::Index rows, Eigen::Index columns, std::uint64_t seed) {
  Matrix m(rows, columns);
  Random random(seed);
  for (Eigen::Index i = 0; i < rows; ++i)
    for (Eigen::Index j = 0; j < columns; ++j)
      m(i, j) = random.normal() * std::pow(10.0, static_cast<double>(i) * 2 - 4);
  return m;
}

TEST(Triangle, KeepsMTimesItsTranspose) {
  using Fixed = Eigen::Matrix<double, 6, 18, Eigen::RowMajor>;
  using Free = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor, 16, 48>;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    check(filled<Fixed>(6, 18, seed));
    for (Eigen::Index rows = 1; rows <= 16; rows += 3)
      check(filled<Free>(rows, rows + static_cast<Eigen::Index>(seed), seed));
  }
}

template <class Matrix>
void check_beside_diagonal(Eigen::Index rows, Eigen::Index columns, std::uint64_t seed) {
  Matrix m = filled<Matrix>(rows, columns, seed);
  const Eigen::VectorXd diagonal = m.rightCols(rows).diagonal();
  m.rightCols(rows) = diagonal.asDiagonal();
  if (seed % 3 == 0) m.row(rows - 1).setZero();
  check(m, true);
}

TEST(Triangle, BesideADiagonalItKeepsMTimesItsTranspose) {
  using Fixed = Eigen::Matrix<double, 4, 8, Eigen::RowMajor>;
  using Free = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor, 16, 48>;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    check_beside_diagonal<Fixed>(4, 8, seed);
    for (Eigen::Index rows = 1; rows <= 16; rows += 3)
      check_beside_diagonal<Free>(rows, rows + static_cast<Eigen::Index>(seed), seed);
  }
}

// Why the root is not made by a Cholesky decomposition of M M', which is as fast: that squares the condition number.
TEST(Triangle, KeepsWhatTheProductLoses) {
  Eigen::Matrix<double, 2, 4, Eigen::RowMajor> m;
  m << 1, 0, 0, 0, 1, 1e-9, 0, 0;
  const Eigen::Matrix2d product = m * m.transpose();
  EXPECT_EQ(product.llt().info(), Eigen::NumericalIssue);
  reduce_to_triangle(m);
  EXPECT_NEAR(std::abs(m(1, 1)), 1e-9, 1e-15);
}

TEST(Triangle, TakesRowsOfZeros) {
  using Free = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Free m = filled<Free>(4, 9, 3);
  m.row(1).setZero();
  m.row(3).setZero();
  check(m);
  check(Free(Free::Zero(3, 3)));
}

}  // namespace
}  // namespace faultline
