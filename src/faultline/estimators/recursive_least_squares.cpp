#include "faultline/estimators/recursive_least_squares.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "faultline/signal/error.h"

namespace faultline {

RecursiveLeastSquares::RecursiveLeastSquares(int parameters, const RecursiveLeastSquaresSettings& settings)
    : n_(parameters),
      settings_(settings),
      root_forgetting_(std::sqrt(settings.forgetting)),
      gain_(std::max(1 - settings.forgetting, 1e-4)) {
  if (n_ < 1 || n_ > kMaximumRegressors)
    throw InputError(fmt::format("least squares of {} parameters: 1 to {} are allowed", n_, kMaximumRegressors));
  if (!(settings.forgetting > 0 && settings.forgetting <= 1))
    throw InputError(
        fmt::format("least squares: forgetting is {:g}; above 0 and up to 1 is allowed", settings.forgetting));
  if (!(settings.initial_variance > 0) || !(settings.covariance_limit >= n_ * settings.initial_variance))
    throw InputError(
        "least squares: covariance_limit must be at least the number of parameters times initial_variance, "
        "which must be above 0");
  std::array<double, kMaximumRegressors> zero{};
  reset(zero.data());
}

void RecursiveLeastSquares::reset(const double* theta) {
  std::copy_n(theta, n_, theta_.begin());
  root_.fill(0);
  for (int i = 0; i < n_; ++i) root_[static_cast<std::size_t>(i * n_ + i)] = std::sqrt(settings_.initial_variance);
  trace_ = n_ * settings_.initial_variance;
  residual_ = surprise_ = noise_variance_ = rows_ = 0;
}

bool RecursiveLeastSquares::step(const double* h, double y) {
  const auto n = static_cast<std::size_t>(n_);
  double square = 0, predicted = 0;
  for (std::size_t i = 0; i < n; ++i) {
    square += h[i] * h[i];
    predicted += h[i] * theta_[i];
  }
  if (!(square >= settings_.excitation * settings_.excitation) || !std::isfinite(square) || !std::isfinite(y) ||
      square == 0)
    return false;
  const double g = settings_.forgetting;
  double vv = 0;
  for (std::size_t j = 0; j < n; ++j) {
    v_[j] = 0;
    for (std::size_t i = 0; i < n; ++i) v_[j] += root_[i * n + j] * h[i];
    vv += v_[j] * v_[j];
  }
  double sv_square = 0;
  for (std::size_t i = 0; i < n; ++i) {
    sv_[i] = 0;
    for (std::size_t j = 0; j < n; ++j) sv_[i] += root_[i * n + j] * v_[j];
    sv_square += sv_[i] * sv_[i];
  }
  residual_ = y - predicted;
  // Where P would outgrow its bound this row is weighed like those before it: no forgetting.
  const bool forget = (trace_ - sv_square / (g + vv)) / g <= settings_.covariance_limit;
  weight_ = forget ? g : 1;
  const double s = weight_ + vv;
  const double take = 1 / (s + std::sqrt(weight_ * s));
  const double grow = forget ? 1 / root_forgetting_ : 1;
  const double step = residual_ / s;
  trace_ = 0;
  for (std::size_t i = 0; i < n; ++i) {
    theta_[i] += sv_[i] * step;
    const double row = take * sv_[i];
    for (std::size_t j = 0; j < n; ++j) {
      double& entry = root_[i * n + j];
      entry = grow * (entry - row * v_[j]);
      trace_ += entry * entry;
    }
  }
  // A plain mean first, so that the first rows do not weigh for ever.
  rows_ += 1;
  surprise_ = residual_ * residual_ * weight_ / s;
  noise_variance_ += std::max(gain_, 1 / rows_) * (surprise_ - noise_variance_);
  return true;
}

double RecursiveLeastSquares::covariance(int i, int j) const {
  double sum = 0;
  for (int k = 0; k < n_; ++k)
    sum += root_[static_cast<std::size_t>(i * n_ + k)] * root_[static_cast<std::size_t>(j * n_ + k)];
  return sum;
}

double RecursiveLeastSquares::standard_deviation(int i) const {
  return std::sqrt(covariance(i, i) * noise_variance_ / (1 + settings_.forgetting));
}

void RecursiveLeastSquares::parameter_covariance(double* result) const {
  for (int i = 0; i < n_; ++i)
    for (int j = 0; j < n_; ++j) *result++ = covariance(i, j) * noise_variance_ / (1 + settings_.forgetting);
}

}  // namespace faultline
