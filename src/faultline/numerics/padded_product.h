// Y = X F' of matrices that are small, but too large for a size that the compiler knows.
//
// X and Y are padded: their columns are as long as whole vectors, so that all loops run along memory. Where the
// processor has AVX2 and FMA, which is asked at run time, the loops are taken as compiled for these
// (sum_of_products.h); the last digits depend on which it was.
#pragma once

#include <Eigen/Core>

namespace faultline {

// Rows of a padded matrix of so many.
Eigen::Index padded(Eigen::Index rows);

// X, Y: n columns of padded(n) rows; F: n by n; column after column.
void multiply_transposed(const double* x, const double* f, Eigen::Index n, double* y);

// P -= g g' w of a padded P and a padded g.
void take_square(const double* g, double weight, Eigen::Index n, double* p);

}  // namespace faultline
