#include "faultline/numerics/sum_of_products.h"

#include <algorithm>
#include <cstddef>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace faultline {
namespace {

using Matrix = Eigen::Ref<const Eigen::MatrixXd>;
using Index = Eigen::Index;

#if defined(__x86_64__)

constexpr Index kRows = 4, kVectors = 3, kColumns = 4 * kVectors;

bool has_kernel() { return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"); }

// Panel after panel, `width` columns each, sample after sample in it; what is wanting to the last panel is 0.
void pack(const Matrix& matrix, Index width, std::vector<double>& panels) {
  const Index samples = matrix.rows(), count = (matrix.cols() + width - 1) / width;
  panels.assign(static_cast<std::size_t>(samples * count * width), 0.0);
  for (Index c = 0; c < matrix.cols(); ++c) {
    double* to = panels.data() + (c / width) * width * samples + c % width;
    for (Index k = 0; k < samples; ++k) to[k * width] = matrix(k, c);
  }
}

// tile (kRows x kColumns, row after row) = the products of a panel of each, summed over the samples.
__attribute__((target("avx2,fma"))) void tile_of(const double* left, const double* right, Index samples, double* tile) {
  __m256d sums[kRows][kVectors];
  for (auto& row : sums)
    for (__m256d& sum : row) sum = _mm256_setzero_pd();
  for (Index k = 0; k < samples; ++k, left += kRows, right += kColumns) {
    __m256d b[kVectors];
    for (Index j = 0; j < kVectors; ++j) b[j] = _mm256_loadu_pd(right + 4 * j);
    for (Index i = 0; i < kRows; ++i) {
      const __m256d a = _mm256_broadcast_sd(left + i);
      for (Index j = 0; j < kVectors; ++j) sums[i][j] = _mm256_fmadd_pd(a, b[j], sums[i][j]);
    }
  }
  for (Index i = 0; i < kRows; ++i)
    for (Index j = 0; j < kVectors; ++j) _mm256_storeu_pd(tile + i * kColumns + 4 * j, sums[i][j]);
}

void add_tiles(const std::vector<double>& left, const std::vector<double>& right, Index samples, Eigen::MatrixXd& sum) {
  double tile[kRows * kColumns];
  for (Index c = 0; c < sum.cols(); c += kColumns) {
    const Index columns = std::min(kColumns, sum.cols() - c);
    for (Index r = 0; r < sum.rows(); r += kRows) {
      const Index rows = std::min(kRows, sum.rows() - r);
      tile_of(left.data() + r * samples, right.data() + c * samples, samples, tile);
      for (Index j = 0; j < columns; ++j)
        for (Index i = 0; i < rows; ++i) sum(r + i, c + j) += tile[i * kColumns + j];
    }
  }
}

#endif

}  // namespace

SumOfProducts::SumOfProducts(Index rows, Index columns) : sum_(Eigen::MatrixXd::Zero(rows, columns)) {}

void SumOfProducts::add(const Matrix& x, const Matrix& y) {
#if defined(__x86_64__)
  static const bool kernel = has_kernel();
  if (kernel) {
    pack(x, kRows, left_);
    pack(y, kColumns, right_);
    add_tiles(left_, right_, x.rows(), sum_);
    return;
  }
#endif
  sum_.noalias() += x.transpose() * y;
}

}  // namespace faultline
