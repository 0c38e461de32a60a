// Recursive least squares with forgetting for y = h' theta + e, theta of n parameters, in Potter's square-root form.
// Sources: Astrom, Wittenmark, Adaptive Control (1995), chapters 2 and 11 (conditional forgetting); Potter's update as
// in Kaminski, Bryson, Schmidt, IEEE Trans. Automatic Control 16 (1971); Iannetti, Marzat, Piet-Lahanier
// et al., Fault diagnosis benchmark for a rocket engine demonstrator (2015), equations (9), (10).
//
// With the covariance P = S S' (per unit of noise variance), forgetting g, v = S' h, s = g + v'v:
//   r = y - h' theta,  theta += S v r/s,  S = (S - S v v'/(s + sqrt(g s)))/sqrt(g)
// P is positive whatever is rounded. Bounded: where trace(P/g) would pass `covariance_limit`, that step does not
// forget, so the trace never passes it however long the input stands still. Excitation guard: |h| below `excitation`
// changes nothing. Variance of theta, for white noise and a window of about 1/(1 - g) samples: P noise_variance/(1 +
// g), noise_variance being the running mean of r^2 g/s; for other noise see coloured_noise.h. Units are the caller's.
// Blind to what it cannot tell: a wrong theta fits a wrong y just as well.
#pragma once

#include <array>

namespace faultline {

constexpr int kMaximumRegressors = 6;

struct RecursiveLeastSquaresSettings {
  double forgetting = 1;        // g, in (0, 1]
  double initial_variance = 1;  // of every parameter at the start, per unit of noise variance
  double covariance_limit = 1;  // largest trace of P; at least n times initial_variance
  double excitation = 0;        // smallest |h| that says something
};

class RecursiveLeastSquares {
 public:
  // Throws InputError for settings that make no sense, or n outside 1..kMaximumRegressors.
  RecursiveLeastSquares(int parameters, const RecursiveLeastSquaresSettings& settings);

  void reset(const double* theta);
  // Takes one row; false if it was not used (too little excitation, or not finite). Allocates nothing.
  bool step(const double* h, double y);

  const double* parameters() const { return theta_.data(); }
  double covariance(int i, int j) const;  // of P
  double covariance_trace() const { return trace_; }
  double forgetting() const { return weight_; }  // with which the last row used was taken: g, or 1
  double residual() const { return residual_; }  // r of the last row used, before its correction
  double surprise() const { return surprise_; }  // r^2 g/s of that row: of the noise's variance where nothing changed
  double noise_variance() const { return noise_variance_; }
  double standard_deviation(int i) const;
  void parameter_covariance(double* result) const;  // of theta, row after row

 private:
  int n_;
  RecursiveLeastSquaresSettings settings_;
  double root_forgetting_, gain_;
  std::array<double, kMaximumRegressors> theta_{}, v_{}, sv_{};
  std::array<double, kMaximumRegressors * kMaximumRegressors> root_{};  // S, row after row
  double trace_ = 0, weight_ = 1, residual_ = 0, surprise_ = 0, noise_variance_ = 0, rows_ = 0;
};

}  // namespace faultline
