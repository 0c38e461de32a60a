// Householder reduction of a wide matrix M (rows <= columns) from the right: M H = [L 0] with L lower triangular and
// L L' = M M'. In place; nothing is allocated. Row-major, so that every pass runs along memory.
#pragma once

#include <cmath>

#include <Eigen/Core>

namespace faultline {

// Reflects row i, and those below it, so that of its columns from `begin` on, `width` of them, only the one on the
// diagonal is left; what it has left of the diagonal stays. kWidth: `width`, where it is known when this is compiled,
// so that all loops have one length that is known.
template <int kWidth, class Matrix>
void reflect_row(Matrix& m, Eigen::Index i, Eigen::Index begin, Eigen::Index width) {
  static_assert(Matrix::IsRowMajor, "rows must lie along memory");
  constexpr int kMost = kWidth == Eigen::Dynamic ? Matrix::MaxColsAtCompileTime : kWidth;
  const Eigen::Index diagonal = i - begin;
  Eigen::Matrix<double, 1, kWidth, Eigen::RowMajor, 1, kMost> pivot = m.row(i).template segment<kWidth>(begin, width);
  pivot.head(diagonal).setZero();
  const double square = pivot.squaredNorm();
  if (square == 0) return;
  const double norm = std::sqrt(square);
  const double head = pivot[diagonal];
  const double alpha = head > 0 ? -norm : norm;
  // Reflection along u = pivot - alpha e_i; |u|^2 = 2 norm (norm + |head|).
  const double scale = 1 / (norm * (norm + std::abs(head)));
  pivot[diagonal] = head - alpha;
  for (Eigen::Index j = i + 1; j < m.rows(); ++j) {
    auto other = m.row(j).template segment<kWidth>(begin, width);
    other -= (scale * other.dot(pivot)) * pivot;
  }
  m.row(i).segment(i, begin + width - i).setZero();
  m(i, i) = alpha;
}

template <class Matrix>
void reduce_to_triangle(Matrix& m) {
  for (Eigen::Index i = 0; i < m.rows(); ++i) reflect_row<Matrix::ColsAtCompileTime>(m, i, 0, m.cols());
}

// The same, in less time, of a matrix whose last columns, as many as it has rows, hold a diagonal one.
template <class Matrix>
void reduce_beside_diagonal(Matrix& m) {
  constexpr int kWidth = Matrix::ColsAtCompileTime == Eigen::Dynamic
                             ? Eigen::Dynamic
                             : Matrix::ColsAtCompileTime - Matrix::RowsAtCompileTime + 1;
  for (Eigen::Index i = 0; i < m.rows(); ++i) reflect_row<kWidth>(m, i, i, m.cols() - m.rows() + 1);
}

}  // namespace faultline
