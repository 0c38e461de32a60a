#include "faultline/estimators/known_model.h"

#include <algorithm>
#include <cmath>

#include "faultline/numerics/quantiles.h"

namespace faultline {
namespace {

constexpr std::size_t kStartsKept = 4;  // motions to borrow the start states' part from

}  // namespace

void KnownModel::learn_healthy(const ModelPoint& point, const Eigen::VectorXd& theta,
                               const std::vector<std::unique_ptr<Stretch>>& recent) {
  known_ = model_.known(point, theta, {});
  for (const auto& stretch : recent) {
    if (!stretch->responded) continue;
    stretch->misfit = 0;  // to first order
    for (const SegmentResponse& segment : stretch->segments) {
      const Eigen::VectorXd left = segment.residuals + segment.tolerances * theta;
      stretch->misfit += model_.weight_of(left) * model_.smooth_square(left);
    }
  }
  const ResponseSettings& settings = model_.settings();
  if (!recent.empty()) {
    misfits_.push_back(recent.back()->misfit);
    if (static_cast<double>(misfits_.size()) > settings.memory_stretches) misfits_.pop_front();
  }
  // White noise as the datasheet has it, where nothing else is known.
  healthy_ = static_cast<double>(settings.segments * model_.outputs()) * static_cast<double>(model_.smooth_terms()) /
             settings.inflation_variances;
  if (!misfits_.empty()) healthy_ = median({misfits_.begin(), misfits_.end()});
  usual_ = healthy_;
}

void KnownModel::learn_inexplicable(double per_stretch) {
  inexplicable_.push_back(std::max(0.0, per_stretch));
  if (static_cast<double>(inexplicable_.size()) > model_.settings().memory_stretches) inexplicable_.pop_front();
}

double KnownModel::inexplicable() const {
  return inexplicable_.empty() ? 0 : median({inexplicable_.begin(), inexplicable_.end()});
}

void KnownModel::learn_fault(const ModelPoint& point, const Eigen::VectorXd& theta,
                             const std::vector<EffectSpec>& faults, const std::vector<std::unique_ptr<Stretch>>& recent,
                             std::size_t count) {
  known_ = model_.known(point, theta, faults);
  usual_ = 0;
  for (std::size_t i = recent.size() - count; i < recent.size(); ++i) {
    recent[i]->misfit = misfit(*recent[i], 0);
    usual_ += recent[i]->misfit / static_cast<double>(count);
  }
  usual_ = std::max(usual_, healthy_);
}

double KnownModel::beyond(Stretch& stretch, double news) {
  stretch.misfit = misfit(stretch, usual_ + news);
  return stretch.misfit - usual_;
}

double KnownModel::misfit(const Stretch& stretch, const Eigen::MatrixXf& residuals,
                          const StartProjection& starts) const {
  double sum = 0;
  for (std::size_t s = 1; s < stretch.run.segments(); ++s) {
    const Eigen::VectorXd left = starts.residual(stretch.run, residuals, s);
    sum += model_.weight_of(left) * model_.smooth_square(left);
  }
  return sum;
}

double KnownModel::misfit(const Stretch& stretch, double enough) {
  const Eigen::MatrixXf whole = model_.residuals(stretch, known_);
  for (const auto& starts : lately_) {
    if (!starts->fits(stretch.run)) continue;
    const double borrowed = misfit(stretch, whole, *starts);
    if (borrowed <= enough) return borrowed;
  }
  // Without effects: they hardly change what a start state does, and runs with them cost more.
  auto own = stretch.responded ? stretch.starts : model_.starts_at({known_.parameters, {}}, stretch.run);
  const double result = misfit(stretch, whole, *own);
  lately_.push_front(std::move(own));
  if (lately_.size() > kStartsKept) lately_.pop_back();
  return result;
}

}  // namespace faultline
