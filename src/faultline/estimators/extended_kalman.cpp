#include "faultline/estimators/extended_kalman.h"

#include "faultline/signal/error.h"

namespace faultline {

ExtendedKalmanFilter::ExtendedKalmanFilter(const ProcessModel& model) : model_(model), s_(model, 1) {
  a_.setZero(s_.n, s_.n);
  c_.setZero(s_.m, s_.n);
  next_.setZero(s_.n);
  const SquareRootState::State origin = SquareRootState::State::Constant(s_.n, 1.0);
  if (!model.jacobian(origin.data(), 1e-3, a_.data()) ||
      (s_.observed.empty() && !model.observe_jacobian(origin.data(), c_.data())))
    throw InputError(
        "extended_kalman: this process model gives no Jacobian; take unscented_kalman or divided_difference_2");
}

void ExtendedKalmanFilter::predict(double dt, double noise_scale) {
  from_ = s_.state;
  model_.predict_linear(from_.data(), dt, next_.data(), a_.data());
  s_.propagate(a_);
  s_.add_noise(dt, noise_scale);
  s_.state = next_;
}

void ExtendedKalmanFilter::predict_beside(const StateEstimator& leader, double dt, double noise_scale) {
  const auto& led = static_cast<const ExtendedKalmanFilter&>(leader);
  if (!model_.near(led.from_.data(), s_.state.data())) return predict(dt, noise_scale);
  next_.noalias() = led.next_ + led.a_.lazyProduct(s_.state - led.from_);
  s_.propagate(led.a_);
  s_.add_noise(dt, noise_scale);
  s_.state = next_;
}

void ExtendedKalmanFilter::correct(const double* y, const bool* use) {
  if (s_.observed.empty()) {
    model_.observe_jacobian(s_.state.data(), c_.data());
    model_.observe(s_.state.data(), s_.predicted.data());
    s_.correct_rows(y, use, c_);
  } else {
    s_.correct_observed(y, use);
  }
}

namespace {

FAULTLINE_STATE_ESTIMATOR(extended_kalman, make_state_estimator_of<ExtendedKalmanFilter>);

}  // namespace

}  // namespace faultline
