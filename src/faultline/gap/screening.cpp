#include "faultline/gap/screening.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "faultline/numerics/in_parallel.h"

namespace faultline {
namespace {

struct Point {
  std::size_t candidate;
  std::vector<double> values;
  double loss = 0;            // at the best fraction of these values' size, residuals taken to grow with it
  double fraction = 1;        // that fraction
  Eigen::VectorXd move = {};  // of the parameters there
  bool tried = false;
};

// What is the same for all points.
struct Base {
  const ResidualModel& residuals;
  const Linearisation& linear;
  const FitResult& fit;
  Eigen::VectorXd deviations;
  SegmentProducts products;  // of the base's residuals
};

FitResult beside(const FitResult& base, const Candidate& candidate, const std::vector<double>& values) {
  FitResult fit;
  fit.effects = base.effects;
  fit.effects.push_back(candidate);
  fit.effects.back().effect.parameters = values;
  fit.model = with_effects(fit.effects, base.model.parameters);
  return fit;
}

// Products of residuals on the line from the base's to `full`, whose middle is `half`.
SegmentProducts on_the_line(const SegmentProducts& none, const SegmentProducts& half, const SegmentProducts& full,
                            double fraction) {
  SegmentProducts part = none;
  for (std::size_t g = 0; g < part.squares.size(); ++g) {
    const double both = 2 * half.squares[g] - 0.5 * (none.squares[g] + full.squares[g]);
    part.squares[g] = std::max(0.0, (1 - fraction) * (1 - fraction) * none.squares[g] +
                                        2 * fraction * (1 - fraction) * both + fraction * fraction * full.squares[g]);
    part.against_parameters[g] += fraction * (full.against_parameters[g] - none.against_parameters[g]);
  }
  return part;
}

void attempt(const Base& base, const Candidate& candidate, Point& point) {
  const Linearisation& linear = base.linear;
  const std::vector<Eigen::MatrixXf>& at_base = linear.at_model();
  std::vector<Eigen::MatrixXf> residuals =
      residuals_of(base.residuals, beside(base.fit, candidate, point.values).model, linear.runs());
  const SegmentProducts full = linear.products(residuals);
  point.loss = projected_loss(linear, full, base.deviations, &point.move);
  for (std::size_t r = 0; r < residuals.size(); ++r) residuals[r] = 0.5f * (residuals[r] + at_base[r]);
  const SegmentProducts half = linear.products(residuals);
  for (const double fraction : linear.options().screening.size_fractions) {
    Eigen::VectorXd move;
    const double loss =
        projected_loss(linear, on_the_line(base.products, half, full, fraction), base.deviations, &move);
    if (loss >= point.loss) continue;
    point.loss = loss;
    point.fraction = fraction;
    point.move = move;
  }
  point.tried = true;
}

// One point in `stride` of each candidate, or its only one.
std::vector<std::size_t> first_tries(const std::vector<Point>& points, std::size_t stride) {
  std::vector<std::size_t> result;
  std::size_t count = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    count = i > 0 && points[i].candidate == points[i - 1].candidate ? count + 1 : 0;
    const bool only = count == 0 && (i + 1 == points.size() || points[i + 1].candidate != points[i].candidate);
    if (count % stride == stride / 2 || only) result.push_back(i);
  }
  return result;
}

// The points not tried yet of those candidates that may reach far.
std::vector<std::size_t> further_tries(const std::vector<Point>& points, std::size_t candidates, double before,
                                       std::size_t followed) {
  std::vector<double> reach(candidates, before);
  for (const Point& point : points)
    if (point.tried) reach[point.candidate] = std::min(reach[point.candidate], point.loss);
  std::vector<double> sorted = reach;
  std::sort(sorted.begin(), sorted.end());
  const double enough = sorted[std::min(followed, sorted.size() - 1)];
  std::vector<std::size_t> result;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (!points[i].tried && reach[points[i].candidate] <= enough) result.push_back(i);
  return result;
}

// The effect at a fraction of its size.
std::vector<double> resized(const Candidate& candidate, std::vector<double> values, double fraction) {
  if (candidate.family == "stuck") return values;  // a time is no size
  const EffectType* type = find_effect_type(candidate.effect.effect);
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double none = type->parameters[i].none;
    if (std::isnan(none)) continue;
    const Bounds& b = candidate.bounds[i];
    values[i] = std::clamp(std::isinf(none) ? values[i] / fraction : none + fraction * (values[i] - none), b.minimum,
                           b.maximum);
  }
  return values;
}

// The best point of each candidate, best first.
std::vector<Screened> best_points(const Base& base, const std::vector<Candidate>& candidates,
                                  const std::vector<Point>& points, double before) {
  std::vector<const Point*> best(candidates.size(), nullptr);
  for (const Point& point : points)
    if (point.tried && (!best[point.candidate] || point.loss < best[point.candidate]->loss))
      best[point.candidate] = &point;
  std::vector<Screened> result;
  for (std::size_t c = 0; c < candidates.size(); ++c) {
    if (!best[c]) continue;
    FitResult fit = beside(base.fit, candidates[c], resized(candidates[c], best[c]->values, best[c]->fraction));
    shift_parameters(base.residuals, base.linear.free_parameters(), best[c]->move, fit.model.parameters);
    result.push_back({std::move(fit), before - best[c]->loss});
  }
  std::stable_sort(result.begin(), result.end(), [](const Screened& a, const Screened& b) { return a.gain > b.gain; });
  return result;
}

// Of an effect that was tried at several lines of a spectrum only the best.
void keep_each_once(std::vector<Screened>& screened) {
  std::vector<Screened> once;
  for (Screened& s : screened)
    if (std::none_of(once.begin(), once.end(), [&](const Screened& better) {
          return same_effect(better.fit.effects.back(), s.fit.effects.back());
        }))
      once.push_back(std::move(s));
  screened = std::move(once);
}

}  // namespace

std::vector<Screened> screen_candidates(const ResidualModel& residuals, const Linearisation& linear,
                                        const std::vector<Candidate>& candidates, const FitResult& base, int jobs,
                                        const std::function<void(double)>& progress) {
  std::vector<Point> points;
  for (std::size_t c = 0; c < candidates.size(); ++c) {
    const bool there = std::any_of(base.effects.begin(), base.effects.end(),
                                   [&](const Candidate& known) { return same_effect(known, candidates[c]); });
    if (there) continue;
    for (auto& values : starting_points(candidates[c], residuals.options().candidates)) points.push_back({c, values});
  }
  if (points.empty()) return {};
  const Base common{residuals, linear, base,
                    deviations(residuals.sheet(), linear.free_parameters(), base.model.parameters),
                    linear.products(linear.at_model())};
  const double before = projected_loss(linear, common.products, common.deviations);
  std::atomic<std::size_t> done{0};
  const auto try_all = [&](const std::vector<std::size_t>& which) {
    in_parallel(which.size(), jobs, [&](std::size_t i) {
      Point& point = points[which[i]];
      attempt(common, candidates[point.candidate], point);
      const std::size_t now = ++done;
      if (progress) progress(static_cast<double>(now) / static_cast<double>(points.size()));
    });
  };
  const GapOptions::Screening& options = residuals.options().screening;
  try_all(first_tries(points, options.first_stride));
  try_all(further_tries(points, candidates.size(), before, options.followed_candidates));
  std::vector<Screened> result = best_points(common, candidates, points, before);
  keep_each_once(result);
  return result;
}

}  // namespace faultline
