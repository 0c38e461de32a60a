#include "faultline/estimators/coloured_noise.h"

#include <algorithm>

namespace faultline {

ColouredNoise::ColouredNoise(int parameters, std::vector<double> autocovariance, double initial_variance)
    : n_(static_cast<std::size_t>(parameters)),
      size_(autocovariance.front()),
      initial_variance_(initial_variance),
      correlation_(autocovariance.begin() + 1, autocovariance.end()) {
  for (double& c : correlation_) c /= size_;
  rows_.resize(correlation_.size() * n_);
  weight_.resize(correlation_.size());
  reset();
}

void ColouredNoise::reset() {
  std::fill(rows_.begin(), rows_.end(), 0);
  std::fill(weight_.begin(), weight_.end(), 1);
  b_.fill(0);
  for (std::size_t i = 0; i < n_; ++i) b_[i * n_ + i] = 1 / initial_variance_;
}

void ColouredNoise::push(const double* h, double forgetting) {
  if (weight_.empty()) return;
  at_ = at_ == 0 ? weight_.size() - 1 : at_ - 1;
  for (std::size_t i = 0; i < n_; ++i) rows_[at_ * n_ + i] = h ? h[i] : 0;
  weight_[at_] = forgetting;
}

void ColouredNoise::skip() { push(nullptr, 1); }

void ColouredNoise::take(const double* h, double forgetting) {
  std::array<double, kMaximumRegressors> u{};
  double weight = forgetting;
  for (std::size_t j = 0, at = at_; j < correlation_.size(); ++j) {
    const double share = weight * correlation_[j];
    for (std::size_t i = 0; i < n_; ++i) u[i] += share * rows_[at * n_ + i];
    weight *= weight_[at];
    if (++at == weight_.size()) at = 0;
  }
  const double fade = forgetting * forgetting;
  for (std::size_t i = 0; i < n_; ++i)
    for (std::size_t j = 0; j < n_; ++j) {
      double& b = b_[i * n_ + j];
      b = fade * b + h[i] * h[j] + h[i] * u[j] + u[i] * h[j];
    }
  push(h, forgetting);
}

void ColouredNoise::covariance(const RecursiveLeastSquares& fit, double* result) const {
  std::array<double, kMaximumRegressors * kMaximumRegressors> p{}, half{};
  for (std::size_t i = 0; i < n_; ++i)
    for (std::size_t j = 0; j < n_; ++j) p[i * n_ + j] = fit.covariance(static_cast<int>(i), static_cast<int>(j));
  for (std::size_t i = 0; i < n_; ++i)
    for (std::size_t j = 0; j < n_; ++j)
      for (std::size_t k = 0; k < n_; ++k) half[i * n_ + j] += p[i * n_ + k] * b_[k * n_ + j];
  const double size = std::max(size_, fit.noise_variance());
  for (std::size_t i = 0; i < n_; ++i)
    for (std::size_t j = 0; j < n_; ++j) {
      double sum = 0;
      for (std::size_t k = 0; k < n_; ++k) sum += half[i * n_ + k] * p[k * n_ + j];
      result[i * n_ + j] = size * sum;
    }
}

}  // namespace faultline
