// Unscented Kalman filter in square-root form, for any process model; needs no Jacobian but that of noisy inputs.
// Source: Julier, Uhlmann, "Unscented filtering and nonlinear estimation", Proc. IEEE 92 (2004); root form after van
// der Merwe, Wan (2001), with k >= 0 so that every weight is positive and a triangle needs no down-dating.
//
// With k = max(0, 3 - n), s = sqrt(n + k), s_p the columns of the root S: points x, x +- s s_p, weights W_0 = k/(n +
// k), W = 1/(2(n+k)).
//   x- = sum W f(point),  S- = triangle [sqrt(W) (f(point) - x-), G sqrt(Q_u), sqrt(Q)]
// The noise is additive, so the points of the correction are drawn anew from S-. Where y are plainly some of the states
// the correction is exact and taken row by row (row_correction.h); else  y- = sum W h(point), C fits h over the points:
//   C = P_xy' P-^-1, and what h bends beyond C adds to the noise of its row (statistical linearisation).
// Beyond three states k = 0: spread sqrt(n) sigma, fourth moments are not matched. Not finite states restart the stage.
#pragma once

#include "faultline/estimators/square_root_state.h"
#include "faultline/estimators/state_estimator.h"

namespace faultline {

class UnscentedKalmanFilter : public StateEstimator {
 public:
  explicit UnscentedKalmanFilter(const ProcessModel& model);

  void reset(const double* state, const double* variance) override { s_.reset(state, variance); }
  void predict(double dt, double noise_scale) override;
  void correct(const double* y, const bool* use) override;

  const double* state() const override { return s_.state.data(); }
  void covariance(double* row_major) const override { s_.covariance(row_major); }
  const double* innovation() const override { return s_.innovation.data(); }
  const double* innovation_std() const override { return s_.innovation_std.data(); }
  double normalised_innovation() const override { return s_.normalised_innovation; }

 private:
  void linearise();  // C and the predicted outputs from the points

  const ProcessModel& model_;
  SquareRootState s_;
  double spread_, centre_weight_, weight_;
  SquareRootState::State probe_, mean_;
  using Points =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kMaximumStates, 2 * kMaximumStates + 1>;
  Points points_, next_;  // the centre, then the sigma points
  SquareRootState::Observation c_, plus_, minus_;
  SquareRootState::Outputs y_middle_, plain_variance_;
};

}  // namespace faultline
