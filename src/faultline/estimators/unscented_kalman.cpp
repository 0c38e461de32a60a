#include "faultline/estimators/unscented_kalman.h"

#include <algorithm>
#include <cmath>

namespace faultline {

UnscentedKalmanFilter::UnscentedKalmanFilter(const ProcessModel& model) : model_(model), s_(model, 2, 1) {
  const double k = std::max(0, 3 - s_.n);
  spread_ = std::sqrt(s_.n + k);
  centre_weight_ = k / (s_.n + k);
  weight_ = 1 / (2 * (s_.n + k));
  for (SquareRootState::State* v : {&probe_, &mean_}) v->setZero(s_.n);
  for (auto* v : {&points_, &next_}) v->setZero(s_.n, 2 * s_.n + 1);
  for (SquareRootState::Observation* v : {&c_, &plus_, &minus_}) v->setZero(s_.m, s_.n);
  y_middle_.setZero(s_.m);
  plain_variance_ = s_.measurement_variance;
}

void UnscentedKalmanFilter::predict(double dt, double noise_scale) {
  const int n = s_.n;
  points_.col(0) = s_.state;
  for (int p = 0; p < 2 * n; ++p) points_.col(1 + p) = s_.state + (p < n ? spread_ : -spread_) * s_.root.col(p % n);
  model_.predict_all(points_.data(), n, 2 * n + 1, dt, next_.data());
  mean_ = centre_weight_ * next_.col(0);
  for (int p = 1; p <= 2 * n; ++p) mean_ += weight_ * next_.col(p);
  const double root_weight = std::sqrt(weight_);
  for (int p = 0; p < 2 * n; ++p) s_.wide.col(p) = root_weight * (next_.col(1 + p) - mean_);
  s_.wide.col(2 * n) = std::sqrt(centre_weight_) * (next_.col(0) - mean_);
  s_.add_noise(dt, noise_scale);
  s_.state = mean_;
}

void UnscentedKalmanFilter::linearise() {
  const int n = s_.n, m = s_.m;
  model_.observe(s_.state.data(), y_middle_.data());
  s_.predicted = centre_weight_ * y_middle_;
  for (int p = 0; p < 2 * n; ++p) {
    const double step = p < n ? spread_ : -spread_;
    probe_ = s_.state + step * s_.root.col(p % n);
    SquareRootState::Outputs y(m);
    model_.observe(probe_.data(), y.data());
    s_.predicted += weight_ * y;
    (p < n ? plus_ : minus_).col(p % n) = y;
  }
  // P_xy = sum W (x_p - x)(y_p - y-)' = S D' with D the halved differences over the spread, so C S = D: C = D S^-1, S
  // triangular.
  for (int i = 0; i < m; ++i) {
    double bend = centre_weight_ * (y_middle_[i] - s_.predicted[i]) * (y_middle_[i] - s_.predicted[i]);
    for (int p = 0; p < n; ++p) {
      const double up = plus_(i, p) - s_.predicted[i], down = minus_(i, p) - s_.predicted[i];
      c_(i, p) = (up - down) / (2 * spread_);
      bend += weight_ * (up * up + down * down) - c_(i, p) * c_(i, p);
    }
    s_.measurement_variance[i] = plain_variance_[i] + std::max(0.0, bend);
    for (int p = n - 1; p >= 0; --p) {
      double sum = c_(i, p);
      for (int j = p + 1; j < n; ++j) sum -= c_(i, j) * s_.root(j, p);
      c_(i, p) = s_.root(p, p) != 0 ? sum / s_.root(p, p) : 0.0;
    }
  }
}

void UnscentedKalmanFilter::correct(const double* y, const bool* use) {
  if (!s_.observed.empty()) {
    s_.correct_observed(y, use);
    return;
  }
  linearise();
  s_.correct_rows(y, use, c_);
}

namespace {

FAULTLINE_STATE_ESTIMATOR(unscented_kalman, make_state_estimator_of<UnscentedKalmanFilter>);

}  // namespace

}  // namespace faultline
