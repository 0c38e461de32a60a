#include "faultline/isolation/parameter_change.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

namespace faultline {
namespace {

constexpr double kKnown = 0.1;    // relative sigma of a reference: what is known worse has no level that could change
constexpr double kUnknown = 1e3;  // sigma of the logarithm of what is not known
constexpr double kLeastRatio = 0.05;  // of a parameter to its reference: far below any fault that is a change of it

// Inverse of a symmetric positive matrix whose rows have units of their own; false where it is not positive.
bool invert(const Eigen::MatrixXd& matrix, Eigen::MatrixXd& inverse) {
  if (!matrix.allFinite() || !(matrix.diagonal().minCoeff() > 0)) return false;
  const Eigen::VectorXd scale = matrix.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::LLT<Eigen::MatrixXd> root(scale.asDiagonal() * matrix * scale.asDiagonal());
  if (root.info() != Eigen::Success) return false;
  inverse =
      scale.asDiagonal() * root.solve(Eigen::MatrixXd::Identity(matrix.rows(), matrix.cols())) * scale.asDiagonal();
  return inverse.allFinite();
}

}  // namespace

ParameterChange::ParameterChange(int parameters, const ParameterChangeOptions& options)
    : n_(parameters),
      options_(options),
      samples_per_block_(static_cast<std::size_t>(std::max(1.0, std::round(options.block_s / options.period_s)))),
      least_blocks_(static_cast<std::size_t>(std::max(1.0, std::ceil(options.least_s / options.block_s - 1e-9)))) {
  const auto blocks = static_cast<std::size_t>(std::max(1.0, std::ceil(options.window_s / options.block_s)));
  current_ = nothing();
  ring_.assign(blocks, current_);
  inflation_ = Eigen::Map<const Eigen::VectorXd>(options_.inflation.data(), n_).cwiseSqrt();
  inflated_.setZero(n_, n_);
  inverse_.setZero(n_, n_);
}

void ParameterChange::reset() {
  head_ = filled_ = samples_ = 0;
  current_ = nothing();
}

bool ParameterChange::add(const double* theta, const double* covariance, bool news) {
  const Eigen::Map<const Eigen::VectorXd> t(theta, n_);
  inflated_ = inflation_.asDiagonal() * Eigen::Map<const Eigen::MatrixXd>(covariance, n_, n_) * inflation_.asDiagonal();
  if (news && t.allFinite() && invert(inflated_, inverse_)) {
    const double weight = options_.period_s / options_.memory_s;
    current_.information += weight * inverse_;
    current_.weighted += weight * (inverse_ * t);
    current_.square += weight * t.dot(inverse_ * t);
  }
  if (++samples_ < samples_per_block_) return false;
  samples_ = 0;
  if (filled_ == 0 && current_.information.isZero(0)) return true;
  ring_[head_] = current_;
  head_ = (head_ + 1) % ring_.size();
  filled_ = std::min(filled_ + 1, ring_.size());
  current_ = nothing();
  return true;
}

double ParameterChange::seconds() const { return static_cast<double>(filled_) * options_.block_s; }

ParameterChange::Block ParameterChange::nothing() const {
  return {Eigen::MatrixXd::Zero(n_, n_), Eigen::VectorXd::Zero(n_), 0};
}

ParameterChange::Block ParameterChange::last(std::size_t blocks) const {
  Block sum = nothing();
  for (std::size_t i = 1; i <= blocks; ++i) {
    const Block& block = ring_[(head_ + ring_.size() - i) % ring_.size()];
    sum.information += block.information;
    sum.weighted += block.weighted;
    sum.square += block.square;
  }
  return sum;
}

std::size_t ParameterChange::blocks_of(double age) const {
  return std::min(filled_, static_cast<std::size_t>(std::max(1.0, std::round(age / options_.block_s))));
}

ParameterLevel ParameterChange::level(double age) const {
  const Block sum = last(blocks_of(age));
  ParameterLevel level;
  if (!invert(sum.information, level.covariance)) return level;
  level.theta = level.covariance * sum.weighted;
  return level;
}

double ParameterChange::expected_scatter(std::size_t blocks) const {
  return n_ * static_cast<double>(blocks) * options_.block_s / options_.memory_s;
}

bool ParameterChange::agrees(double age) const {
  const std::size_t blocks = blocks_of(age);
  const Block sum = last(blocks);
  Eigen::MatrixXd covariance;
  if (!invert(sum.information, covariance)) return false;
  return sum.square - sum.weighted.dot(covariance * sum.weighted) <= options_.scatter * expected_scatter(blocks);
}

ParameterStep ParameterChange::compare(const ParameterLevel& reference, const Block& sum, std::size_t blocks) const {
  ParameterStep step;
  Eigen::MatrixXd covariance;
  if (!invert(sum.information, covariance)) return step;
  const Eigen::VectorXd theta = covariance * sum.weighted;
  const Eigen::VectorXd scale = reference.theta.cwiseInverse();
  const Eigen::ArrayXd ratio = (theta.array() * scale.array()).max(kLeastRatio);
  step.change = ratio.log();
  const Eigen::VectorXd own = scale.array() / ratio.min(1);
  step.age = static_cast<double>(blocks) * options_.block_s;
  step.scatter = sum.square - sum.weighted.dot(theta);
  const auto known = [&](double spread) {
    Eigen::MatrixXd v = own.asDiagonal() * (spread * covariance) * own.asDiagonal();
    for (int i = 0; i < n_; ++i) v(i, i) += std::pow(v(i, i) / options_.shown[static_cast<std::size_t>(i)], 2);
    v += scale.asDiagonal() * reference.covariance * scale.asDiagonal();
    for (int i = 0; i < n_; ++i) {
      v(i, i) += std::pow(options_.floor[static_cast<std::size_t>(i)], 2);
      const double relative = std::sqrt(reference.covariance(i, i)) * std::abs(scale[i]);
      v(i, i) += std::pow(relative * relative / options_.shown[static_cast<std::size_t>(i)], 2);
      if (!(relative <= kKnown)) v(i, i) += kUnknown * kUnknown;
    }
    return v;
  };
  const Eigen::VectorXd away = theta - reference.theta;
  step.allowance = std::pow(options_.relative_error, 2) * away.dot(sum.information * away);
  const double expected = expected_scatter(blocks);
  const Eigen::MatrixXd judged = known(std::max(1.0, (step.scatter - step.allowance) / expected));
  step.chi2 = step.change.dot(judged.ldlt().solve(step.change));
  step.covariance = step.allowance > 0 && step.scatter > expected ? known(step.scatter / expected) : judged;
  return step;
}

ParameterStep ParameterChange::step_from(const ParameterLevel& reference) const {
  Block sum = nothing();
  ParameterStep best, pending, step;
  double most = 0;
  for (std::size_t i = 1; i <= filled_; ++i) {
    const Block& block = ring_[(head_ + ring_.size() - i) % ring_.size()];
    sum.information += block.information;
    sum.weighted += block.weighted;
    sum.square += block.square;
    if (i < least_blocks_) continue;
    step = compare(reference, sum, i);
    if (step.age == 0) continue;
    const double agree = options_.scatter * expected_scatter(i) + step.allowance - step.scatter;
    if (agree >= 0 && step.chi2 > pending.chi2) pending = step;
    if (agree > most) {
      most = agree;
      best = pending;
    }
  }
  return best;
}

ParameterStep ParameterChange::step_from(const ParameterLevel& reference, double age) const {
  const std::size_t blocks = blocks_of(age);
  return compare(reference, last(blocks), blocks);
}

}  // namespace faultline
