#include "faultline/gap/run_phases.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

#include <Eigen/Dense>

#include "faultline/numerics/in_parallel.h"
#include "faultline/rig/swing.h"

namespace faultline {
namespace {

constexpr double kTwoPi = 6.283185307179586;
constexpr double kProbe = 0.25;  // of the largest amplitude
constexpr double kAside = 0.25;  // of the width of a line

double middle(const Bounds& bounds) { return 0.5 * (bounds.minimum + bounds.maximum); }

// M = [s c]'[s c] and z = -[s c]'r of a run.
struct Normal {
  Eigen::Matrix2d m = Eigen::Matrix2d::Zero();
  Eigen::Vector2d z = Eigen::Vector2d::Zero();

  Eigen::Vector2d solution() const { return m.ldlt().solve(z); }
  double gain() const {
    const double won = 0.5 * z.dot(solution());
    return std::isfinite(won) ? won : 0;
  }
};

Normal normal(const SegmentedRun& run, const Eigen::MatrixXf& left, const Eigen::MatrixXf& sine,
              const Eigen::MatrixXf& cosine) {
  Normal result;
  const auto rows = static_cast<Eigen::Index>(run.segment);
  for (const std::size_t restart : run.restarts) {
    const auto first = static_cast<Eigen::Index>(restart);
    if (first + rows > left.rows()) break;
    const auto r = left.middleRows(first, rows).cast<double>();
    const Eigen::MatrixXd s = (sine - left).middleRows(first, rows).cast<double>();
    const Eigen::MatrixXd c = (cosine - left).middleRows(first, rows).cast<double>();
    const double weight = 1 / std::max(1.0, r.squaredNorm() / static_cast<double>(r.size()));
    result.m(0, 0) += weight * s.squaredNorm();
    result.m(1, 1) += weight * c.squaredNorm();
    result.m(0, 1) += weight * s.cwiseProduct(c).sum();
    result.z[0] -= weight * s.cwiseProduct(r).sum();
    result.z[1] -= weight * c.cwiseProduct(r).sum();
  }
  result.m(1, 0) = result.m(0, 1);
  return result;
}

double count_of(const std::vector<Eigen::MatrixXf>& residuals) {
  double count = 0;
  for (const Eigen::MatrixXf& run : residuals) count += static_cast<double>((run.array() != 0).count());
  return count;
}

// What a candidate does in each run beside the model that stands, at a frequency.
class Swings {
 public:
  Swings(const ResidualModel& model, const ModelChange& standing, int jobs)
      : model_(model), standing_(standing), jobs_(jobs), runs_(model.runs()), left_(model.runs().size()) {
    for (SegmentedRun& run : runs_) run.ahead = run.turned = 0;
    in_parallel(runs_.size(), jobs_, [&](std::size_t r) { left_[r] = residuals(standing_, r); });
  }

  std::vector<Normal> at(const Candidate& candidate, const Swing& swing, double frequency) const {
    const double none = find_effect_type(candidate.effect.effect)->parameters[0].none;
    ModelChange sine = standing_;
    sine.effects.push_back(candidate.effect);
    std::vector<double>& parameters = sine.effects.back().parameters;
    parameters[0] = none + kProbe * (candidate.bounds[0].maximum - none);
    parameters[swing.frequency] = frequency;
    parameters[swing.phase] = 0;
    ModelChange cosine = sine;
    cosine.effects.back().parameters[swing.phase] = kTwoPi / 4;
    std::vector<Normal> of(runs_.size());
    in_parallel(runs_.size(), jobs_,
                [&](std::size_t r) { of[r] = normal(runs_[r], left_[r], residuals(sine, r), residuals(cosine, r)); });
    return of;
  }
  const std::vector<Eigen::MatrixXf>& left() const { return left_; }

 private:
  Eigen::MatrixXf residuals(const ModelChange& change, std::size_t r) const {
    return model_.model().residuals(change, runs_[r], model_.noise());
  }

  const ResidualModel& model_;
  const ModelChange& standing_;
  int jobs_;
  std::vector<SegmentedRun> runs_;
  std::vector<Eigen::MatrixXf> left_;
};

double gain_of_each(const std::vector<Normal>& runs) {
  double sum = 0;
  for (const Normal& run : runs) sum += run.gain();
  return sum;
}

std::optional<Swing> swing_of(const EffectSpec& effect) {
  return faultline::swing_of(*find_effect_type(effect.effect));
}

// What swings already has its phases.
bool swings_already(const ModelChange& standing) {
  return std::any_of(standing.effects.begin(), standing.effects.end(),
                     [](const EffectSpec& effect) { return swing_of(effect).has_value(); });
}

}  // namespace

std::vector<double> likeliest_orders(const ResidualModel& model, const ModelChange& standing,
                                     const std::vector<Candidate>& candidates, int jobs) {
  std::vector<double> orders(candidates.size(), std::nan(""));
  if (swings_already(standing)) return orders;
  std::unique_ptr<Swings> swings;  // only where something may swing
  for (std::size_t c = 0; c < candidates.size(); ++c) {
    const std::optional<Swing> swing = swing_of(candidates[c].effect);
    if (!swing || !swing->by_angle) continue;
    if (!swings) swings = std::make_unique<Swings>(model, standing, jobs);
    const Bounds& range = candidates[c].bounds[swing->frequency];
    double most = 0;
    for (double order = std::ceil(range.minimum); order <= range.maximum; ++order) {
      const double gain = gain_of_each(swings->at(candidates[c], *swing, order));
      if (gain > most) most = gain, orders[c] = order;
    }
  }
  return orders;
}

std::vector<Candidate> at_orders(std::vector<Candidate> candidates, const std::vector<double>& orders) {
  for (std::size_t c = 0; c < orders.size(); ++c)
    if (!std::isnan(orders[c]))
      candidates[c].bounds[swing_of(candidates[c].effect)->frequency] = {orders[c], orders[c]};
  return candidates;
}

RunPhases run_phases(const ResidualModel& model, const ModelChange& standing, const std::vector<Candidate>& candidates,
                     int jobs) {
  RunPhases phases;
  for (const SegmentedRun& run : model.runs()) {
    phases.ahead.push_back(run.ahead);
    phases.turned.push_back(run.turned);
  }
  const std::size_t count = phases.ahead.size();
  if (swings_already(standing)) return phases;
  phases.ahead.assign(count, 0.0);
  phases.turned = phases.ahead;
  std::unique_ptr<Swings> swings;  // only where something may swing
  const Candidate* best = nullptr;
  std::optional<Swing> swing;
  std::vector<Normal> runs;
  for (const Candidate& candidate : candidates) {
    const std::optional<Swing> of_candidate = swing_of(candidate.effect);
    if (!of_candidate) continue;
    if (!swings) swings = std::make_unique<Swings>(model, standing, jobs);
    std::vector<Normal> of = swings->at(candidate, *of_candidate, middle(candidate.bounds[of_candidate->frequency]));
    if (best && gain_of_each(of) <= gain_of_each(runs)) continue;
    best = &candidate;
    swing = of_candidate;
    runs = std::move(of);
  }
  if (!best) return phases;
  phases.closed = 2 * gain_of_each(runs) / std::max(count_of(swings->left()), 1.0);
  Normal all;
  for (const Normal& run : runs) {
    all.m += run.m;
    all.z += run.z;
  }
  if (count < 2 || all.gain() >= model.options().spectrum.one_phase_fraction * gain_of_each(runs)) return phases;
  // A line is known to a part of its width, over which phases at the beginnings of runs turn; an order is whole.
  const Bounds& width = best->bounds[swing->frequency];
  double f = middle(width);
  if (const double step = kAside * (width.maximum - width.minimum); step > 0) {
    const double less = gain_of_each(swings->at(*best, *swing, f - step)), here = gain_of_each(runs),
                 more = gain_of_each(swings->at(*best, *swing, f + step));
    if (const double bend = less + more - 2 * here; bend < 0) {
      f += std::clamp(0.5 * step * (less - more) / bend, -2 * step, 2 * step);
      runs = swings->at(*best, *swing, f);
    }
  }
  const auto phase_of = [](const Normal& run) {
    const Eigen::Vector2d solution = run.solution();
    return std::atan2(solution[1], solution[0]);
  };
  std::vector<double>& by = swing->by_angle ? phases.turned : phases.ahead;
  for (std::size_t r = 1; r < count; ++r) {
    const double turned = std::remainder(phase_of(runs[r]) - phase_of(runs[0]), kTwoPi);
    if (std::isfinite(turned)) by[r] = turned / swing->rate(f);  // a run may say nothing
  }
  return phases;
}

}  // namespace faultline
