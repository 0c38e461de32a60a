#include "faultline/numerics/padded_product.h"

namespace faultline {
namespace {

using Index = Eigen::Index;
using Lanes [[gnu::vector_size(32), gnu::may_alias, gnu::aligned(8)]] = double;  // four at once

constexpr Index kLanes = 4, kRows = 2 * kLanes, kColumns = 4;

// Columns `first` to `first + count` of Y = X F'.
template <int kCount>
[[gnu::always_inline]] inline void columns_of(const double* x, const double* f, Index n, Index rows, Index first,
                                              double* y) {
  for (Index r = 0; r < rows; r += kRows) {
    Lanes upper[kCount], lower[kCount];
    for (int j = 0; j < kCount; ++j) upper[j] = lower[j] = Lanes{};
    for (Index k = 0; k < n; ++k) {
      const Lanes a = *reinterpret_cast<const Lanes*>(x + k * rows + r);
      const Lanes b = *reinterpret_cast<const Lanes*>(x + k * rows + r + kLanes);
      for (int j = 0; j < kCount; ++j) {
        const double weight = f[k * n + first + j];
        upper[j] += weight * a;
        lower[j] += weight * b;
      }
    }
    for (int j = 0; j < kCount; ++j) {
      double* to = y + (first + j) * rows + r;
      *reinterpret_cast<Lanes*>(to) = upper[j];
      *reinterpret_cast<Lanes*>(to + kLanes) = lower[j];
    }
  }
}

// Y = X F'; X and Y: n columns of `rows` each, F: n by n.
[[gnu::always_inline]] inline void product_of(const double* x, const double* f, Index n, Index rows, double* y) {
  Index j = 0;
  for (; j + kColumns <= n; j += kColumns) columns_of<kColumns>(x, f, n, rows, j, y);
  for (; j < n; ++j) columns_of<1>(x, f, n, rows, j, y);
}

[[gnu::always_inline]] inline void lessen(const double* g, double weight, Index n, Index rows, double* p) {
  for (Index j = 0; j < n; ++j) {
    const double share = g[j] * weight;
    for (Index r = 0; r < rows; r += kLanes)
      *reinterpret_cast<Lanes*>(p + j * rows + r) -= share * *reinterpret_cast<const Lanes*>(g + r);
  }
}

#if defined(__x86_64__)

const bool kHasKernel = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");

[[gnu::target("avx2,fma")]] void product_quickly(const double* x, const double* f, Index n, Index rows, double* y) {
  product_of(x, f, n, rows, y);
}

[[gnu::target("avx2,fma")]] void lessen_quickly(const double* g, double weight, Index n, Index rows, double* p) {
  lessen(g, weight, n, rows, p);
}

#else

constexpr bool kHasKernel = false;
constexpr auto product_quickly = product_of;
constexpr auto lessen_quickly = lessen;

#endif

}  // namespace

Index padded(Index rows) { return (rows + kRows - 1) / kRows * kRows; }

void multiply_transposed(const double* x, const double* f, Index n, double* y) {
  (kHasKernel ? product_quickly : product_of)(x, f, n, padded(n), y);
}

void take_square(const double* g, double weight, Index n, double* p) {
  (kHasKernel ? lessen_quickly : lessen)(g, weight, n, padded(n), p);
}

}  // namespace faultline
