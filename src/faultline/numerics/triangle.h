// Householder reduction of a wide matrix M (rows <= columns) from the right: M H = [L 0] with L lower triangular and
// L L' = M M'. In place; nothing is allocated. Row-major, so that every pass runs along memory.
// Columns left of the diagonal are passed over with a zero instead of being left out: all loops then have one length,
// which a matrix of fixed size tells the compiler.
#pragma once

#include <cmath>

#include <Eigen/Core>

namespace faultline {

template <class Matrix>
void reduce_to_triangle(Matrix& m) {
  static_assert(Matrix::IsRowMajor, "rows must lie along memory");
  const auto rows = m.rows(), columns = m.cols();
  Eigen::Matrix<double, 1, Matrix::ColsAtCompileTime, Eigen::RowMajor, 1, Matrix::MaxColsAtCompileTime> pivot(columns);
  for (Eigen::Index i = 0; i < rows; ++i) {
    pivot = m.row(i);
    pivot.head(i).setZero();
    const double square = pivot.squaredNorm();
    if (square == 0) continue;
    const double norm = std::sqrt(square);
    const double head = pivot[i];
    const double alpha = head > 0 ? -norm : norm;
    // Reflection along u = pivot - alpha e_i; |u|^2 = 2 norm (norm + |head|).
    const double scale = 1 / (norm * (norm + std::abs(head)));
    pivot[i] = head - alpha;
    for (Eigen::Index j = i + 1; j < rows; ++j) {
      auto other = m.row(j);
      other -= (scale * other.dot(pivot)) * pivot;
    }
    m.row(i).tail(columns - i).setZero();
    m(i, i) = alpha;
  }
}

}  // namespace faultline
