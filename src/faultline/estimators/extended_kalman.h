// Extended Kalman filter in square-root form, for any process model that gives its Jacobians.
// Sources: Simon, Optimal State Estimation (2006), chapter 13; Iannetti, Marzat, Piet-Lahanier et al., Fault diagnosis
// benchmark for a rocket engine demonstrator (2015), equations (11)-(18).
//
//   x- = f(x, u),  P- = A P A' + G Q_u G' + Q:   S- = triangle [A S, G sqrt(Q_u), sqrt(Q)]
//   rows of y one after the other: off = y_i - h_i(x-) - C_i (x - x-),  then row_correction.h with h = C_i
// A, G and C are the model's, at the last estimate and at x-. Q_u is the noise of measured inputs. The innovation is
// told against x-. Beside a filter on the same model whose state x_0 is near: x- = f(x_0, u) + A(x_0)(x - x_0), its A.
// As every extended filter it is good to first order: where f bends within the spread of P the
// covariance is too small. Throws InputError where the model has no Jacobian. Fails where the model returns something
// not finite: the stage restarts.
#pragma once

#include "faultline/estimators/square_root_state.h"
#include "faultline/estimators/state_estimator.h"

namespace faultline {

class ExtendedKalmanFilter : public StateEstimator {
 public:
  explicit ExtendedKalmanFilter(const ProcessModel& model);

  void reset(const double* state, const double* variance) override { s_.reset(state, variance); }
  void predict(double dt, double noise_scale) override;
  void predict_beside(const StateEstimator& leader, double dt, double noise_scale) override;
  void correct(const double* y, const bool* use) override;

  const double* state() const override { return s_.state.data(); }
  void covariance(double* row_major) const override { s_.covariance(row_major); }
  const double* innovation() const override { return s_.innovation.data(); }
  const double* innovation_std() const override { return s_.innovation_std.data(); }
  double normalised_innovation() const override { return s_.normalised_innovation; }

 private:
  const ProcessModel& model_;
  SquareRootState s_;
  SquareRootState::Square a_;
  SquareRootState::Observation c_;
  SquareRootState::State from_, next_;  // x, x- of the last step
};

}  // namespace faultline
