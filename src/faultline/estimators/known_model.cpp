#include "faultline/estimators/known_model.h"

#include <algorithm>
#include <cmath>

#include "faultline/numerics/quantiles.h"

namespace faultline {
namespace {

constexpr std::size_t kStartsKept = 4;  // motions to borrow the start states' part from
constexpr double kBeyondUsual = 2;      // times the most mean square of a segment that was usual

template <class Values>
void remember(Values& values, double value, double most) {
  values.push_back(value);
  if (static_cast<double>(values.size()) > most) values.pop_front();
}

double mean_square(const Eigen::VectorXd& residuals) {
  return residuals.squaredNorm() / static_cast<double>(residuals.size());
}

}  // namespace

void KnownModel::learn_healthy(const ModelPoint& point, const Eigen::VectorXd& theta,
                               const std::vector<std::unique_ptr<Stretch>>& recent) {
  known_ = model_.known(point, theta, {});
  with_fault_ = 0;
  const double memory = model_.settings().memory_stretches;
  if (!recent.empty() && recent.back()->responded) {
    double most = 0;
    for (const SegmentResponse& segment : recent.back()->segments)
      most = std::max(most, mean_square(segment.residuals + segment.tolerances * theta));
    remember(squares_, most, memory);
  }
  for (const auto& stretch : recent) {
    if (!stretch->responded) continue;
    stretch->misfit = 0;  // to first order
    for (const SegmentResponse& segment : stretch->segments) {
      const Eigen::VectorXd left = segment.residuals + segment.tolerances * theta;
      stretch->misfit += model_.weight_of(left, most_usual()) * model_.smooth_square(left);
    }
  }
  const ResponseSettings& settings = model_.settings();
  if (!recent.empty()) remember(misfits_, recent.back()->misfit, memory);
  // White noise as the datasheet has it, where nothing else is known.
  healthy_ = static_cast<double>(settings.segments * model_.outputs()) * static_cast<double>(model_.smooth_terms()) /
             settings.inflation_variances;
  if (!misfits_.empty()) healthy_ = median({misfits_.begin(), misfits_.end()});
  usual_ = healthy_;
}

void KnownModel::learn_inexplicable(double per_stretch) {
  remember(inexplicable_, std::max(0.0, per_stretch), model_.settings().memory_stretches);
}

double KnownModel::inexplicable() const {
  return inexplicable_.empty() ? 0 : median({inexplicable_.begin(), inexplicable_.end()});
}

void KnownModel::learn_fault(const ModelPoint& point, const Eigen::VectorXd& theta,
                             const std::vector<EffectSpec>& faults, const std::vector<std::unique_ptr<Stretch>>& recent,
                             std::size_t count) {
  known_ = model_.known(point, theta, faults);
  usual_ = with_fault_ = 0;
  std::vector<Eigen::MatrixXf> left;
  for (std::size_t i = recent.size() - count; i < recent.size(); ++i) {
    left.push_back(model_.residuals(*recent[i], known_));
    for (std::size_t s = 1; s < recent[i]->run.segments(); ++s)
      with_fault_ = std::max(with_fault_, mean_square(recent[i]->starts->residual(recent[i]->run, left.back(), s)));
  }
  for (std::size_t i = 0; i < count; ++i) {
    Stretch& stretch = *recent[recent.size() - count + i];
    stretch.misfit = misfit(stretch, left[i], *stretch.starts);
    usual_ += stretch.misfit / static_cast<double>(count);
    keep_starts(stretch.starts);
  }
  usual_ = std::max(usual_, healthy_);
}

double KnownModel::most_usual() const {
  if (squares_.empty()) return kInfinity;
  return kBeyondUsual * std::max(with_fault_, *std::max_element(squares_.begin(), squares_.end()));
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
    sum += model_.weight_of(left, most_usual()) * model_.smooth_square(left);
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
  keep_starts(std::move(own));
  return result;
}

void KnownModel::keep_starts(std::shared_ptr<const StartProjection> starts) {
  lately_.push_front(std::move(starts));
  if (lately_.size() > kStartsKept) lately_.pop_back();
}

}  // namespace faultline
