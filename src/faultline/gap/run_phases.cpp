#include "faultline/gap/run_phases.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

#include <Eigen/Dense>
#include <Eigen/Geometry>

#include "faultline/numerics/in_parallel.h"
#include "faultline/rig/swing.h"

namespace faultline {
namespace {

constexpr double kTwoPi = 6.283185307179586;
constexpr double kProbe = 0.25;  // of the largest amplitude
constexpr int kFrequencies = 2;  // of an effect that are tried: the first may be of another cause
constexpr double kAside = 0.25;  // of the width of a line

// So many times the amplitude with which responses are found.
double probed_size(const Candidate& candidate, double times) {
  const double none = find_effect_type(candidate.effect.effect)->parameters[0].none;
  return none + times * kProbe * (candidate.bounds[0].maximum - none);
}

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
    ModelChange sine = standing_;
    sine.effects.push_back(candidate.effect);
    std::vector<double>& parameters = sine.effects.back().parameters;
    parameters[0] = probed_size(candidate, 1);
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

// What a candidate does at its frequency.
struct Swung {
  std::size_t candidate;
  Swing swing;
  std::vector<Normal> runs;
};

// Of all runs in their phases: [s c] of the first.
Normal together(const Swung& swung, const RunPhases& phases, double frequency) {
  Normal all;
  const std::vector<double>& by = swung.swing.by_angle ? phases.turned : phases.ahead;
  for (std::size_t r = 0; r < swung.runs.size(); ++r) {
    const Eigen::Matrix2d turn = Eigen::Rotation2Dd(swung.swing.rate(frequency) * by[r]).toRotationMatrix();
    all.m += turn.transpose() * swung.runs[r].m * turn;
    all.z += turn.transpose() * swung.runs[r].z;
  }
  return all;
}

// A line is known to a part of its width, over which phases at the beginnings of runs turn; an order is whole.
void find_phases(const Swings& swings, const Candidate& candidate, const Swung& swung, RunPhases& phases) {
  const Bounds& width = candidate.bounds[swung.swing.frequency];
  double f = middle(width);
  std::vector<Normal> runs = swung.runs;
  if (const double step = kAside * (width.maximum - width.minimum); step > 0) {
    const double less = gain_of_each(swings.at(candidate, swung.swing, f - step)), here = gain_of_each(runs),
                 more = gain_of_each(swings.at(candidate, swung.swing, f + step));
    if (const double bend = less + more - 2 * here; bend < 0) {
      f += std::clamp(0.5 * step * (less - more) / bend, -2 * step, 2 * step);
      runs = swings.at(candidate, swung.swing, f);
    }
  }
  const auto phase_of = [](const Normal& run) {
    const Eigen::Vector2d solution = run.solution();
    return std::atan2(solution[1], solution[0]);
  };
  std::vector<double>& by = swung.swing.by_angle ? phases.turned : phases.ahead;
  for (std::size_t r = 1; r < runs.size(); ++r) {
    const double turned = std::remainder(phase_of(runs[r]) - phase_of(runs[0]), kTwoPi);
    if (std::isfinite(turned)) by[r] = turned / swung.swing.rate(f);  // a run may say nothing
  }
}

// Begins each where it wins most, and leaves the best frequencies of each effect.
void keep_best(const std::vector<Swung>& swung, const RunPhases& phases, std::vector<Candidate>& candidates) {
  std::vector<double> gains(candidates.size(), std::nan(""));  // of what swings
  for (const Swung& one : swung) {
    Candidate& candidate = candidates[one.candidate];
    const Bounds &size = candidate.bounds[0], &width = candidate.bounds[one.swing.frequency];
    const Normal all = together(one, phases, middle(width));
    gains[one.candidate] = all.gain();
    const Eigen::Vector2d solution = all.solution();
    if (!solution.allFinite()) continue;
    std::vector<double> start = candidate.effect.parameters;
    start[0] = std::clamp(probed_size(candidate, solution.norm()), size.minimum, size.maximum);
    // Beside a line the phase in the middle of a run stays what it is, which is as long as the line is narrow.
    const double aside = width.maximum > width.minimum ? kAside : 0;
    for (const double by : aside > 0 ? std::vector<double>{-aside, 0, aside} : std::vector<double>{0}) {
      start[one.swing.frequency] = middle(width) + by * (width.maximum - width.minimum);
      start[one.swing.phase] = std::remainder(std::atan2(solution[1], solution[0]) - by * kTwoPi / 2, kTwoPi);
      candidate.starts.push_back(start);
    }
  }
  std::vector<Candidate> left;
  for (std::size_t c = 0; c < candidates.size(); ++c) {
    int before = 0;
    for (const Swung& other : swung)
      before += other.candidate != c && same_effect(candidates[c], candidates[other.candidate]) &&
                (gains[other.candidate] > gains[c] || (gains[other.candidate] == gains[c] && other.candidate < c));
    if (before < kFrequencies) left.push_back(candidates[c]);
  }
  candidates = std::move(left);
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

RunPhases run_phases(const ResidualModel& model, const ModelChange& standing, std::vector<Candidate>& candidates,
                     int jobs) {
  RunPhases phases;
  for (const SegmentedRun& run : model.runs()) {
    phases.ahead.push_back(run.ahead);
    phases.turned.push_back(run.turned);
  }
  if (swings_already(standing)) return phases;
  phases.ahead.assign(phases.ahead.size(), 0.0);
  phases.turned = phases.ahead;
  std::unique_ptr<Swings> swings;  // only where something may swing
  std::vector<Swung> swung;
  for (std::size_t c = 0; c < candidates.size(); ++c) {
    const std::optional<Swing> swing = swing_of(candidates[c].effect);
    if (!swing) continue;
    if (!swings) swings = std::make_unique<Swings>(model, standing, jobs);
    swung.push_back({c, *swing, swings->at(candidates[c], *swing, middle(candidates[c].bounds[swing->frequency]))});
  }
  if (swung.empty()) return phases;
  const auto& best = *std::max_element(swung.begin(), swung.end(), [](const Swung& a, const Swung& b) {
    return gain_of_each(a.runs) < gain_of_each(b.runs);
  });
  phases.closed = 2 * gain_of_each(best.runs) / std::max(count_of(swings->left()), 1.0);
  if (together(best, phases, middle(candidates[best.candidate].bounds[best.swing.frequency])).gain() <
      model.options().spectrum.one_phase_fraction * gain_of_each(best.runs))
    find_phases(*swings, candidates[best.candidate], best, phases);
  keep_best(swung, phases, candidates);
  return phases;
}

}  // namespace faultline
