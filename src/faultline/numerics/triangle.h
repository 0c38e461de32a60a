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

namespace detail {

// reflect_row() from the diagonal on, `at` points to it, where all lengths are known when this is compiled: what takes
// the time then is one root and one division.
template <int kWidth, int kStride>
inline void reflect_known(double* at, int below) {
  double pivot[kWidth];
  double even = 0, odd = 0;  // two sums, which do not wait for each other
  for (int k = 0; k < kWidth; ++k) {
    pivot[k] = at[k];
    (k % 2 == 0 ? even : odd) += pivot[k] * pivot[k];
    at[k] = 0;
  }
  const double square = even + odd;
  if (square == 0) return;
  const double norm = std::sqrt(square);
  const double alpha = pivot[0] > 0 ? -norm : norm;
  const double scale = 1 / (square + norm * std::abs(pivot[0]));
  pivot[0] -= alpha;
  for (int row = 1; row <= below; ++row) {
    double* other = at + row * kStride;
    even = odd = 0;
    for (int k = 0; k < kWidth; ++k) (k % 2 == 0 ? even : odd) += other[k] * pivot[k];
    const double share = scale * (even + odd);
    for (int k = 0; k < kWidth; ++k) other[k] -= share * pivot[k];
  }
  at[0] = alpha;
}

}  // namespace detail

// The same, in less time, of a matrix whose last columns, as many as it has rows, hold a diagonal one.
template <class Matrix>
void reduce_beside_diagonal(Matrix& m) {
  constexpr int kRows = Matrix::RowsAtCompileTime, kColumns = Matrix::ColsAtCompileTime;
  if constexpr (kRows == Eigen::Dynamic || kColumns == Eigen::Dynamic) {
    for (Eigen::Index i = 0; i < m.rows(); ++i) reflect_row<Eigen::Dynamic>(m, i, i, m.cols() - m.rows() + 1);
  } else {
    static_assert(Matrix::IsRowMajor, "rows must lie along memory");
    for (int i = 0; i < kRows; ++i)
      detail::reflect_known<kColumns - kRows + 1, kColumns>(m.data() + i * (kColumns + 1), kRows - 1 - i);
  }
}

}  // namespace faultline
