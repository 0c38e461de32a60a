#include "faultline/gap/run_phases.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include <Eigen/Dense>

#include "faultline/numerics/in_parallel.h"

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

// What a candidate does in each run beside the model that stands, at a frequency.
class Swings {
 public:
  Swings(const ResidualModel& model, const ModelChange& standing, int jobs)
      : model_(model), standing_(standing), jobs_(jobs), runs_(model.runs()), left_(model.runs().size()) {
    for (SegmentedRun& run : runs_) run.ahead = 0;
    in_parallel(runs_.size(), jobs_, [&](std::size_t r) { left_[r] = residuals(standing_, r); });
  }

  std::vector<Normal> at(const Candidate& candidate, std::size_t frequency, std::size_t phase, double value) const {
    const double none = find_effect_type(candidate.effect.effect)->parameters[0].none;
    ModelChange sine = standing_;
    sine.effects.push_back(candidate.effect);
    sine.effects.back().parameters[0] = none + kProbe * (candidate.bounds[0].maximum - none);
    sine.effects.back().parameters[frequency] = value;
    ModelChange cosine = sine;
    cosine.effects.back().parameters[phase] = kTwoPi / 4;
    std::vector<Normal> of(runs_.size());
    in_parallel(runs_.size(), jobs_,
                [&](std::size_t r) { of[r] = normal(runs_[r], left_[r], residuals(sine, r), residuals(cosine, r)); });
    return of;
  }

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

}  // namespace

std::vector<double> run_phases(const ResidualModel& model, const ModelChange& standing,
                               const std::vector<Candidate>& candidates, int jobs) {
  std::vector<double> ahead;
  for (const SegmentedRun& run : model.runs()) ahead.push_back(run.ahead);
  const bool swinging = std::any_of(standing.effects.begin(), standing.effects.end(), [](const EffectSpec& effect) {
    return find_effect_type(effect.effect)->with_unit("rad") < effect.parameters.size();
  });
  if (swinging || ahead.size() < 2) return ahead;  // what swings already has its phases
  ahead.assign(ahead.size(), 0.0);
  std::unique_ptr<Swings> swings;  // only where something may swing
  const Candidate* best = nullptr;
  std::size_t frequency = 0, phase = 0;
  std::vector<Normal> runs;
  for (const Candidate& candidate : candidates) {
    const EffectType& type = *find_effect_type(candidate.effect.effect);
    const std::size_t hertz = type.with_unit("Hz"), radians = type.with_unit("rad");
    if (hertz >= candidate.bounds.size() || radians >= candidate.bounds.size()) continue;
    if (!swings) swings = std::make_unique<Swings>(model, standing, jobs);
    std::vector<Normal> of = swings->at(candidate, hertz, radians, middle(candidate.bounds[hertz]));
    if (best && gain_of_each(of) <= gain_of_each(runs)) continue;
    best = &candidate;
    frequency = hertz;
    phase = radians;
    runs = std::move(of);
  }
  if (!best) return ahead;
  Normal all;
  for (const Normal& run : runs) {
    all.m += run.m;
    all.z += run.z;
  }
  if (all.gain() >= model.options().spectrum.one_phase_fraction * gain_of_each(runs)) return ahead;
  // A line is known to a part of its width, over which phases at the beginnings of runs turn.
  const Bounds& width = best->bounds[frequency];
  double f = middle(width);
  const double step = kAside * (width.maximum - width.minimum);
  const double less = gain_of_each(swings->at(*best, frequency, phase, f - step)), here = gain_of_each(runs),
               more = gain_of_each(swings->at(*best, frequency, phase, f + step));
  if (const double bend = less + more - 2 * here; bend < 0) {
    f += std::clamp(0.5 * step * (less - more) / bend, -2 * step, 2 * step);
    runs = swings->at(*best, frequency, phase, f);
  }
  const auto phase_of = [](const Normal& run) {
    const Eigen::Vector2d solution = run.solution();
    return std::atan2(solution[1], solution[0]);
  };
  for (std::size_t r = 1; r < ahead.size(); ++r) {
    const double turned = std::remainder(phase_of(runs[r]) - phase_of(runs[0]), kTwoPi);
    if (std::isfinite(turned)) ahead[r] = turned / (kTwoPi * f);  // a run may say nothing
  }
  return ahead;
}

}  // namespace faultline
