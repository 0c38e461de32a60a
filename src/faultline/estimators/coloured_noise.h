// Covariance of what recursive least squares (recursive_least_squares.h) estimate where the errors of the equation are
// not white: rows that went through filters share the noise of several samples.
//
//   theta_k - theta = P_k sum_i w_i h_i e_i,   E e_i e_j = c_|i-j|,   w_i the forgetting since row i
//   cov theta_k = P_k B_k P_k
//   B_k = g^2 B_k-1 + c_0 h h' + h u' + u h',   u = sum_{j=1..J} c_j w_k-j h_k-j
// which is exact for rows that are known and errors of that autocovariance; the recursion starts where the first guess
// has the covariance P_0 c_0. Source of the form: Hansen, Econometrica 50 (1982); Soderstrom, Stoica, System
// Identification (1989), chapter 7. The autocovariance gives the colour and the least size: where the residuals'
// running variance is larger than c_0, the covariance grows with it. Blind to what is no noise: a term that the
// equation lacks, and the noise of the rows themselves, which pulls estimates towards zero.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "faultline/estimators/recursive_least_squares.h"

namespace faultline {

class ColouredNoise {
 public:
  // `autocovariance` c_0 to c_J of the equation's error, c_0 above 0; `initial_variance` as that of the least squares.
  ColouredNoise(int parameters, std::vector<double> autocovariance, double initial_variance);

  void reset();
  // One sample on, with the row that least squares took and the forgetting it took it with, or with none. Allocates
  // nothing.
  void take(const double* h, double forgetting);
  void skip();
  // Row after row.
  void covariance(const RecursiveLeastSquares& fit, double* result) const;

 private:
  void push(const double* h, double forgetting);

  std::size_t n_;
  double size_, initial_variance_;     // c_0
  std::vector<double> correlation_;    // c_j/c_0 of lags 1 to J
  std::vector<double> rows_, weight_;  // the latest J rows in a ring, and the forgetting that came with each
  std::size_t at_ = 0;                 // of the latest
  std::array<double, kMaximumRegressors * kMaximumRegressors> b_{};
};

}  // namespace faultline
