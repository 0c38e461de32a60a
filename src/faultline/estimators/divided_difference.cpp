#include "faultline/estimators/divided_difference.h"

#include <cmath>

#include "faultline/estimators/observed_correction.h"
#include "faultline/numerics/triangle.h"

namespace faultline {
namespace {

constexpr double kStepSquared = 3;  // h^2: kurtosis of a Gaussian
const double kStep = std::sqrt(kStepSquared);
const double kSecond = std::sqrt(kStepSquared - 1) / (2 * kStepSquared);

}  // namespace

template <int States, int Order>
DividedDifferenceFilter<States, Order>::DividedDifferenceFilter(const ProcessModel& model)
    : model_(model),
      n_(static_cast<int>(model.states().size())),
      m_(static_cast<int>(model.measured_channels().size())),
      observed_(model.observed_states()) {
  const std::vector<double> q = model.process_noise(), r = model.measurement_noise();
  process_root_ = Eigen::Map<const Eigen::VectorXd>(q.data(), n_).cwiseSqrt();
  measurement_root_ = Eigen::Map<const Eigen::VectorXd>(r.data(), m_).cwiseSqrt();
  for (Vector* v : {&plus_, &minus_, &middle_, &probe_, &mean_, &state_}) v->setZero(n_);
  for (Outputs* v : {&y_plus_, &y_minus_, &y_middle_, &y_mean_, &innovation_, &innovation_std_, &solved_})
    v->setZero(m_);
  root_.setZero(n_, n_);
  wide_.setZero(n_, kBlocks * n_);
}

template <int States, int Order>
void DividedDifferenceFilter<States, Order>::reset(const double* state, const double* variance) {
  state_ = Eigen::Map<const Eigen::VectorXd>(state, n_);
  root_.setZero();
  for (int i = 0; i < n_; ++i) root_(i, i) = std::sqrt(variance[i]);
  innovation_.setZero();
  innovation_std_.setZero();
  normalised_innovation_ = 0;
}

template <int States, int Order>
void DividedDifferenceFilter<States, Order>::predict(double dt, double noise_scale) {
  const int n = kFixed ? States : n_;
  model_.predict(state_.data(), dt, middle_.data());
  if (Order == 2)
    mean_ = (kStepSquared - n) / kStepSquared * middle_;
  else
    mean_ = middle_;
  for (int p = 0; p < n; ++p) {
    probe_ = state_ + kStep * root_.col(p);
    model_.predict(probe_.data(), dt, plus_.data());
    probe_ = state_ - kStep * root_.col(p);
    model_.predict(probe_.data(), dt, minus_.data());
    wide_.col(p) = (plus_ - minus_) / (2 * kStep);
    if (Order == 2) {
      wide_.col(n + p) = kSecond * (plus_ + minus_ - 2 * middle_);
      mean_ += (plus_ + minus_) / (2 * kStepSquared);
    }
  }
  wide_.rightCols(n).setZero();
  const double scale = std::sqrt(noise_scale);
  for (int i = 0; i < n; ++i) wide_(i, (kBlocks - 1) * n + i) = scale * process_root_[i];
  reduce_to_triangle(wide_);
  root_ = wide_.leftCols(n);
  state_ = mean_;
}

template <int States, int Order>
void DividedDifferenceFilter<States, Order>::correct(const double* y, const bool* use) {
  innovation_.setZero();
  innovation_std_.setZero();
  normalised_innovation_ = 0;
  int rows[kMaximumOutputs];
  int m = 0;
  for (int i = 0; i < m_; ++i)
    if (use[i]) rows[m++] = i;
  if (m == 0) return;
  if (observed_.empty())
    correct_differences(y, rows, m);
  else
    correct_observed(y, rows, m);
}

template <int States, int Order>
void DividedDifferenceFilter<States, Order>::correct_observed(const double* y, const int* rows, int m) {
  // Innovations are told against the prediction, all rows of it, before the first of them corrects anything.
  for (int i = 0; i < m; ++i) {
    const int r = rows[i], k = observed_[static_cast<std::size_t>(r)];
    innovation_[r] = y[r] - state_[k];
    innovation_std_[r] = std::sqrt(root_.row(k).squaredNorm() + measurement_root_[r] * measurement_root_[r]);
  }
  for (int i = 0; i < m; ++i) {
    const int r = rows[i];
    normalised_innovation_ += correct_observed_state(state_, root_, observed_[static_cast<std::size_t>(r)], y[r],
                                                     measurement_root_[r] * measurement_root_[r]);
  }
}

template <int States, int Order>
void DividedDifferenceFilter<States, Order>::correct_differences(const double* y, const int* rows, int m) {
  const int second = Order == 2 ? n_ : 0;
  first_.resize(m, n_);
  if (Order == 2) second_.resize(m, n_);
  model_.observe(state_.data(), y_middle_.data());
  y_mean_ = Order == 2 ? Outputs((kStepSquared - n_) / kStepSquared * y_middle_) : y_middle_;
  for (int p = 0; p < n_; ++p) {
    probe_ = state_ + kStep * root_.col(p);
    model_.observe(probe_.data(), y_plus_.data());
    probe_ = state_ - kStep * root_.col(p);
    model_.observe(probe_.data(), y_minus_.data());
    for (int i = 0; i < m; ++i) {
      const int r = rows[i];
      first_(i, p) = (y_plus_[r] - y_minus_[r]) / (2 * kStep);
      if (Order == 2) second_(i, p) = kSecond * (y_plus_[r] + y_minus_[r] - 2 * y_middle_[r]);
    }
    if (Order == 2) y_mean_ += (y_plus_ + y_minus_) / (2 * kStepSquared);
  }

  output_wide_.setZero(m, n_ + second + m);
  output_wide_.leftCols(n_) = first_;
  if (Order == 2) output_wide_.middleCols(n_, n_) = second_;
  for (int i = 0; i < m; ++i) output_wide_(i, n_ + second + i) = measurement_root_[rows[i]];
  reduce_to_triangle(output_wide_);
  output_root_ = output_wide_.leftCols(m);

  solved_.resize(m);
  for (int i = 0; i < m; ++i) {
    const int r = rows[i];
    innovation_[r] = y[r] - y_mean_[r];
    innovation_std_[r] = output_root_.row(i).head(i + 1).norm();
    solved_[i] = innovation_[r];
  }
  // K = S Y1' (Sy Sy')^-1: with G = S Y1', solve K Sy Sy' = G row by row, by the two triangles.
  gain_.noalias() = root_ * first_.transpose();
  for (int row = 0; row < n_; ++row) {
    for (int i = 0; i < m; ++i) {
      double sum = gain_(row, i);
      for (int j = 0; j < i; ++j) sum -= output_root_(i, j) * gain_(row, j);
      gain_(row, i) = sum / output_root_(i, i);
    }
    for (int i = m - 1; i >= 0; --i) {
      double sum = gain_(row, i);
      for (int j = i + 1; j < m; ++j) sum -= output_root_(j, i) * gain_(row, j);
      gain_(row, i) = sum / output_root_(i, i);
    }
  }
  state_.noalias() += gain_ * solved_;
  for (int i = 0; i < m; ++i) {
    for (int j = 0; j < i; ++j) solved_[i] -= output_root_(i, j) * solved_[j];
    solved_[i] /= output_root_(i, i);
  }
  normalised_innovation_ = solved_.squaredNorm();

  corrected_.resize(n_, n_ + m + second);
  corrected_.leftCols(n_) = root_;
  corrected_.leftCols(n_).noalias() -= gain_ * first_;
  for (int i = 0; i < m; ++i) corrected_.col(n_ + i) = gain_.col(i) * measurement_root_[rows[i]];
  if (Order == 2) corrected_.rightCols(n_).noalias() = gain_ * second_;
  reduce_to_triangle(corrected_);
  root_ = corrected_.leftCols(n_);
}

template <int States, int Order>
void DividedDifferenceFilter<States, Order>::covariance(double* row_major) const {
  Eigen::Map<Root>(row_major, n_, n_).noalias() = root_.lazyProduct(root_.transpose());
}

namespace {

// With matrices of fixed size where the model has six states, which is about twice as fast as the general form.
template <int Order>
std::unique_ptr<StateEstimator> make(const ProcessModel& model) {
  if (model.states().size() == 6) return std::make_unique<DividedDifferenceFilter<6, Order>>(model);
  return std::make_unique<DividedDifferenceFilter<Eigen::Dynamic, Order>>(model);
}

FAULTLINE_STATE_ESTIMATOR(divided_difference_1, make<1>);
FAULTLINE_STATE_ESTIMATOR(divided_difference_2, make<2>);

}  // namespace

}  // namespace faultline
