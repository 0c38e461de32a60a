#include "faultline/signal/state_variable_filter.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Dense>
#include <unsupported/Eigen/MatrixFunctions>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kSameStep = 1e-4;  // relative
using Square =
    Eigen::Matrix<double, StateVariableFilter::kMaximumOrder + StateVariableFilter::kMaximumInterpolation + 1,
                  StateVariableFilter::kMaximumOrder + StateVariableFilter::kMaximumInterpolation + 1>;

}  // namespace

StateVariableFilter::StateVariableFilter(int order, double bandwidth, int interpolation, std::size_t signals)
    : n_(static_cast<std::size_t>(order)),
      r_(static_cast<std::size_t>(interpolation)),
      bandwidth_(bandwidth),
      state_(signals) {
  if (order < 1 || order > kMaximumOrder)
    throw InputError(fmt::format("state variable filter of order {}: 1 to {} are allowed", order, kMaximumOrder));
  if (interpolation < 0 || interpolation > kMaximumInterpolation)
    throw InputError(fmt::format("state variable filter with interpolation of order {}: 0 to {} are allowed",
                                 interpolation, kMaximumInterpolation));
  if (!(bandwidth > 0) || !std::isfinite(bandwidth))
    throw InputError(fmt::format("state variable filter: the bandwidth is {:g} rad/s; it must be above 0", bandwidth));
  for (std::size_t i = 0; i < kStates; ++i) power_[i] = std::pow(bandwidth, static_cast<double>(i));
}

void StateVariableFilter::reset(const double* signals) {
  before_ = made_before_ = 0;
  for (std::size_t s = 0; s < state_.size(); ++s) {
    state_[s].z.fill(0);
    state_[s].z[0] = signals[s];
    state_[s].x.fill(signals[s]);
  }
}

void StateVariableFilter::make_step() {
  // In time over the latest step h and with z scaled by powers of w, everything is of the size of 1 or w h.
  const double h = spacing_[0], a = bandwidth_ * h;
  Square both = Square::Zero();
  double binomial = 1;
  for (std::size_t i = 0; i < n_; ++i) {
    if (i + 1 < n_) both(static_cast<int>(i), static_cast<int>(i) + 1) = a;
    // (s + 1)^n = sum binomial(n, i) s^i
    both(static_cast<int>(n_) - 1, static_cast<int>(i)) -= a * binomial;
    binomial *= static_cast<double>(n_ - i) / static_cast<double>(i + 1);
  }
  both(static_cast<int>(n_) - 1, kMaximumOrder) = a;
  for (int i = 0; i < kMaximumInterpolation; ++i) both(kMaximumOrder + i, kMaximumOrder + i + 1) = 1;
  const Square step = both.exp();

  // Samples at u = 1, 0, -h_1/h, -(h_1 + h_2)/h are sum_i c_i u^i/i!; order 0 has c_0 alone, the sample at u = 0.
  const std::size_t order = r_ == 0 ? 0 : before_;
  Eigen::Matrix4d from_samples = Eigen::Matrix4d::Zero();
  if (order == 0) {
    from_samples(0, 1) = 1;
  } else {
    Eigen::Matrix4d power = Eigen::Matrix4d::Identity();
    double u = 1;
    for (std::size_t j = 0; j <= order; ++j) {
      double term = 1;
      for (std::size_t i = 0; i <= order; ++i) {
        power(static_cast<int>(j), static_cast<int>(i)) = term;
        term *= u / static_cast<double>(i + 1);
      }
      if (j < order) u -= spacing_[j] / h;
    }
    from_samples = power.inverse();
    for (std::size_t i = order + 1; i < kSamples; ++i) from_samples.row(static_cast<int>(i)).setZero();
  }
  const Eigen::Matrix4d weight = step.topRightCorner<4, 4>() * from_samples;
  for (std::size_t i = 0; i < kStates; ++i)
    for (std::size_t j = 0; j < kStates; ++j) {
      carry_[i * kStates + j] = step(static_cast<int>(i), static_cast<int>(j));
      weight_[i * kSamples + j] = weight(static_cast<int>(i), static_cast<int>(j));
    }
  made_for_ = spacing_;
  made_before_ = before_;
}

void StateVariableFilter::step(const double* signals, double dt) {
  const std::size_t used = std::max<std::size_t>(r_, 1);  // samples before the latest
  for (std::size_t i = used; i-- > 1;) spacing_[i] = spacing_[i - 1];
  spacing_[0] = dt;
  before_ = std::min(before_ + 1, used);
  bool same = before_ == made_before_;
  for (std::size_t i = 0; i < before_; ++i)
    same = same && std::abs(spacing_[i] - made_for_[i]) <= kSameStep * made_for_[i];
  if (!same) make_step();

  for (std::size_t s = 0; s < state_.size(); ++s) {
    Signal& of = state_[s];
    for (std::size_t i = used; i > 0; --i) of.x[i] = of.x[i - 1];
    of.x[0] = signals[s];
    std::array<double, kStates> z{};
    for (std::size_t i = 0; i < n_; ++i) {
      for (std::size_t j = 0; j < n_; ++j) z[i] += carry_[i * kStates + j] * of.z[j];
      for (std::size_t j = 0; j <= used; ++j) z[i] += weight_[i * kSamples + j] * of.x[j];
    }
    of.z = z;
  }
}

}  // namespace faultline
