// Householder reduction of a wide matrix M (rows <= columns) from the right: M H = [L 0] with L lower triangular and
// L L' = M M'. In place; nothing is allocated. Row-major, so that every pass runs along memory.
#pragma once

#include <cmath>

namespace faultline {

template <class Matrix>
void reduce_to_triangle(Matrix& m) {
  const auto rows = m.rows(), columns = m.cols();
  for (Eigen::Index i = 0; i < rows; ++i) {
    const auto length = columns - i;
    auto pivot = m.row(i).segment(i, length);
    const double norm = pivot.norm();
    if (norm == 0) continue;
    const double head = pivot[0];
    const double alpha = head > 0 ? -norm : norm;
    // Reflection along u = pivot - alpha e_1; |u|^2 = 2 norm (norm + |head|).
    const double scale = 1 / (norm * (norm + std::abs(head)));
    pivot[0] = head - alpha;
    for (Eigen::Index j = i + 1; j < rows; ++j) {
      auto other = m.row(j).segment(i, length);
      other -= (scale * other.dot(pivot)) * pivot;
    }
    pivot.setZero();
    m(i, i) = alpha;
  }
}

}  // namespace faultline
