// LU factors of a small full matrix, in place, by loops whose length the compiler knows; pivots by column.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

namespace faultline {

constexpr int kFewStates = 8;  // up to which a matrix counts as small

// L (unit diagonal) and U in place of A, column by column, of rows in `order`; the diagonal holds 1/U. NaN where A is
// singular.
template <std::size_t kSize>
void factor_in_place(double* a, int* order) {
  for (std::size_t i = 0; i < kSize; ++i) order[i] = static_cast<int>(i);
  for (std::size_t k = 0; k < kSize; ++k) {
    std::size_t pivot = k;
    for (std::size_t i = k + 1; i < kSize; ++i)
      if (std::abs(a[k * kSize + i]) > std::abs(a[k * kSize + pivot])) pivot = i;
    if (pivot != k) {
      std::swap(order[k], order[pivot]);
      for (std::size_t j = 0; j < kSize; ++j) std::swap(a[j * kSize + k], a[j * kSize + pivot]);
    }
    const double over = a[k * kSize + k] != 0 ? 1 / a[k * kSize + k] : std::numeric_limits<double>::quiet_NaN();
    for (std::size_t i = k + 1; i < kSize; ++i) a[k * kSize + i] *= over;
    for (std::size_t j = k + 1; j < kSize; ++j)
      for (std::size_t i = k + 1; i < kSize; ++i) a[j * kSize + i] -= a[k * kSize + i] * a[j * kSize + k];
    a[k * kSize + k] = over;
  }
}

template <std::size_t kSize>
void solve_in_place(const double* a, const int* order, double* right_side) {
  std::array<double, kSize> x;
  for (std::size_t i = 0; i < kSize; ++i) x[i] = right_side[order[i]];
  for (std::size_t k = 0; k < kSize; ++k)
    for (std::size_t i = k + 1; i < kSize; ++i) x[i] -= a[k * kSize + i] * x[k];
  for (std::size_t k = kSize; k-- > 0;) {
    x[k] *= a[k * kSize + k];
    for (std::size_t i = 0; i < k; ++i) x[i] -= a[k * kSize + i] * x[k];
  }
  for (std::size_t i = 0; i < kSize; ++i) right_side[i] = x[i];
}

// The inverse, row by row, from the factors: more work than one right side, but half the time of four calls of
// solve_in_place(), since its columns do not wait for one another.
template <std::size_t kSize>
void invert(const double* a, const int* order, double* inverse) {
  for (std::size_t i = 0; i < kSize; ++i)
    for (std::size_t c = 0; c < kSize; ++c) inverse[i * kSize + c] = static_cast<int>(c) == order[i] ? 1.0 : 0.0;
  const auto subtract = [inverse](std::size_t from, double times, std::size_t row) {
    for (std::size_t c = 0; c < kSize; ++c) inverse[from * kSize + c] -= times * inverse[row * kSize + c];
  };
  for (std::size_t k = 0; k < kSize; ++k)
    for (std::size_t i = k + 1; i < kSize; ++i) subtract(i, a[k * kSize + i], k);
  for (std::size_t k = kSize; k-- > 0;) {
    for (std::size_t c = 0; c < kSize; ++c) inverse[k * kSize + c] *= a[k * kSize + k];
    for (std::size_t i = 0; i < k; ++i) subtract(i, a[k * kSize + i], k);
  }
}

}  // namespace faultline
