#include "faultline/gap/gap_trials.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>

#include "faultline/gap/parallel.h"

namespace faultline {
namespace {

constexpr double kSamplesCorrelate = 20;  // samples of a misfit that say the same
constexpr int kSteps = 4;                 // Gauss-Newton steps around one linearisation
constexpr int kQuickSteps = 3;
constexpr int kMostRounds = 5;         // linearisations of the refit
constexpr int kRefineRounds = 2;       // ... and of a structure that is followed
constexpr double kSettled = 100;       // gain in log likelihood that is not worth another linearisation
constexpr double kLongestReach = 3;    // times the size of a starting point
constexpr std::size_t kFollowed = 20;  // candidates of which all starting points are tried

}  // namespace

double sum(const std::vector<double>& values) { return std::accumulate(values.begin(), values.end(), 0.0); }

double standard_error(const std::vector<double>& values) {
  double size = 0;
  for (const double v : values) size += std::abs(v);
  return std::sqrt(2 * kSamplesCorrelate * size);
}

std::vector<double> minus(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> result(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) result[i] = a[i] - b[i];
  return result;
}

std::vector<double> robust(const std::vector<double>& losses, double values_per_segment) {
  std::vector<double> result;
  for (const double loss : losses)
    result.push_back(0.5 * values_per_segment * std::log(std::max(2 * loss / values_per_segment, 0.2)));
  return result;
}

GapTrials::GapTrials(const Datasheet& sheet, std::vector<GapRun> runs, const std::vector<Fold>& folds,
                     const std::vector<std::size_t>& learn, const GapSettings& settings, const GapProgress& progress)
    : sheet_(sheet),
      settings_(settings),
      progress_(progress),
      model_(sheet, std::move(runs), gap_segment(sheet)),
      folds_(folds),
      learn_(learn) {
  double duration = 0;
  for (const GapRun& run : model_.runs())
    duration = std::max(duration, static_cast<double>(run.recording.rows()) * sheet.sample_period);
  all_ = candidates(sheet, settings.without, duration);
  for (std::size_t i = 0; i < model_.runs().size(); ++i) every_.push_back(i);
}

void GapTrials::tell(double share, const std::string& text) const {
  if (progress_) progress_(share, text);
}

std::unique_ptr<Linearisation> GapTrials::settle(ResidualModel& model, const GapModel& at, int jobs) const {
  std::vector<std::vector<Eigen::MatrixXf>> starts(every_.size());
  parallel(every_.size(), jobs, [&](std::size_t i) { starts[i] = model.settle_starts(at, every_[i]); });
  return std::make_unique<Linearisation>(model, at, every_, jobs, std::move(starts));
}

FitResult GapTrials::refit(const GapModel& start, const std::vector<Candidate>& effects) {
  FitResult fit;
  fit.model = with_effects(effects, start.parameters);
  fit.effects = effects;
  double before = 0;
  for (int round = 0; round <= kMostRounds; ++round) {
    linear_ = settle(model_, fit.model, settings_.jobs);
    const Linearisation learn = linear_->subset(learn_);
    const double now = sum(robust(learn.segment_losses(learn.at_model()), segment_values()));
    if (round == kMostRounds || (round > 1 && before - now < kSettled)) break;
    before = now;
    const FitResult better = fit_gap(model_, fit.model, fit.effects, learn, kSteps);
    fit = better;
  }
  return fit;
}

FitResult GapTrials::stand(const GapModel& model) {
  FitResult fit;
  fit.model = model;
  linear_ = settle(model_, model, settings_.jobs);
  return fit;
}

std::vector<Structure> GapTrials::screen(const FitResult& base, double from, double to) const {
  struct Point {
    std::size_t candidate;
    std::vector<double> values;
    double loss = 0;   // at these values
    double reach = 0;  // what any size of this shape would have, the shape taken as fixed
    bool tried = false;
  };
  std::vector<Point> points;
  for (std::size_t c = 0; c < all_.size(); ++c) {
    const bool there = std::any_of(base.effects.begin(), base.effects.end(), [&](const Candidate& e) {
      return e.effect.effect == all_[c].effect.effect && e.effect.port == all_[c].effect.port;
    });
    if (there) continue;
    for (auto& values : starting_points(all_[c])) points.push_back({c, values});
  }
  const Eigen::VectorXd z = deviations(sheet_, linear_->free_parameters(), base.model.parameters);
  const std::vector<Eigen::MatrixXf>& at_model = linear_->at_model();
  const double before = projected_loss(*linear_, at_model, z);
  std::atomic<std::size_t> done{0};
  const auto attempt = [&](Point& point) {
    std::vector<Candidate> effects = base.effects;
    effects.push_back(all_[point.candidate]);
    effects.back().effect.parameters = point.values;
    std::vector<Eigen::MatrixXf> residuals = residuals_of(model_, with_effects(effects, base.model.parameters), every_);
    point.loss = projected_loss(*linear_, residuals, z);
    // Along the line from the model to this point the projected loss is a parabola.
    for (std::size_t r = 0; r < residuals.size(); ++r) residuals[r] = 0.5f * (residuals[r] + at_model[r]);
    const double middle = projected_loss(*linear_, residuals, z);
    const double curvature = 2 * (before + point.loss - 2 * middle), slope = point.loss - before - curvature;
    const double at = curvature > 0 ? std::clamp(-slope / (2 * curvature), 0.0, kLongestReach) : 0;
    point.reach = std::min(point.loss, before + slope * at + curvature * at * at);
    point.tried = true;
    const std::size_t now = ++done;
    if (progress_)
      progress_(from + (to - from) * static_cast<double>(now) / static_cast<double>(points.size()), "trying effects");
  };
  // First one point in three of each candidate, then the others of those candidates that may reach far.
  std::vector<std::size_t> first, second;
  std::size_t count = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    count = i > 0 && points[i].candidate == points[i - 1].candidate ? count + 1 : 0;
    if (count % 3 == 1) first.push_back(i);
    if (count == 0 && (i + 1 == points.size() || points[i + 1].candidate != points[i].candidate)) first.push_back(i);
  }
  parallel(first.size(), settings_.jobs, [&](std::size_t i) { attempt(points[first[i]]); });
  std::vector<double> reach(all_.size(), before);
  for (const Point& point : points)
    if (point.tried) reach[point.candidate] = std::min(reach[point.candidate], point.reach);
  std::vector<double> sorted = reach;
  std::sort(sorted.begin(), sorted.end());
  const double enough = sorted[std::min(kFollowed, sorted.size() - 1)];
  for (std::size_t i = 0; i < points.size(); ++i)
    if (!points[i].tried && reach[points[i].candidate] <= enough) second.push_back(i);
  parallel(second.size(), settings_.jobs, [&](std::size_t i) { attempt(points[second[i]]); });

  std::vector<Structure> result;
  for (std::size_t c = 0; c < all_.size(); ++c) {
    const Point* best = nullptr;
    for (const Point& point : points)
      if (point.candidate == c && point.tried && (!best || point.loss < best->loss)) best = &point;
    if (!best) continue;
    Structure structure;
    structure.fit.effects = base.effects;
    structure.fit.effects.push_back(all_[c]);
    structure.fit.effects.back().effect.parameters = best->values;
    structure.screened = before - best->loss;
    result.push_back(std::move(structure));
  }
  std::stable_sort(result.begin(), result.end(),
                   [](const Structure& a, const Structure& b) { return a.screened > b.screened; });
  return result;
}

void GapTrials::shortlist(const FitResult& base, std::vector<Structure>& structures, double from, double to) const {
  const Linearisation learn = linear_->subset(learn_);
  const auto weighted = [&](const GapModel& model) {
    return sum(robust(learn.segment_losses(residuals_of(model_, model, learn_)), segment_values()));
  };
  const double before = weighted(base.model);
  std::atomic<std::size_t> done{0};
  parallel(structures.size(), settings_.jobs, [&](std::size_t i) {
    Structure& structure = structures[i];
    structure.fit = fit_gap(model_, base.model, structure.fit.effects, learn, kQuickSteps);
    structure.quick = before - weighted(structure.fit.model);
    const std::size_t now = ++done;
    if (progress_)
      progress_(from + (to - from) * static_cast<double>(now) / static_cast<double>(structures.size()),
                "fitting the best");
  });
  std::stable_sort(structures.begin(), structures.end(),
                   [](const Structure& a, const Structure& b) { return a.quick > b.quick; });
}

void GapTrials::refine(Structure& structure, int jobs) const {
  auto own = std::make_unique<ResidualModel>(model_);
  std::unique_ptr<Linearisation> linear = settle(*own, structure.fit.model, jobs);
  const auto loss = [&](const Linearisation& at) {
    const Linearisation learn = at.subset(learn_);
    return sum(robust(learn.segment_losses(learn.at_model()), segment_values()));
  };
  double best = loss(*linear);
  for (int round = 0; round < kRefineRounds; ++round) {
    const FitResult fit = fit_gap(*own, structure.fit.model, structure.fit.effects, linear->subset(learn_), kSteps);
    auto moved = std::make_unique<ResidualModel>(*own);
    std::unique_ptr<Linearisation> around = settle(*moved, fit.model, jobs);
    const double now = loss(*around);
    if (now >= best) break;
    const bool settled = best - now < kSettled;
    best = now;
    structure.fit = fit;
    own = std::move(moved);
    linear = std::move(around);
    if (settled) break;
  }
  structure.fit.covariance = uncertainty(*own, structure.fit, linear->subset(learn_));
  cross_score(*own, *linear, structure);
}

void GapTrials::cross_score(const ResidualModel& model, const Linearisation& linear, Structure& structure) const {
  const FitResult& fit = structure.fit;
  structure.held_out.clear();
  for (const Fold& fold : folds_) {
    const bool same = fold.train == learn_;
    const FitResult part = same ? fit : fit_effects(model, fit.model, fit.effects, linear.subset(fold.train), kSteps);
    const auto losses = linear.subset(fold.test).segment_losses(residuals_of(model, part.model, fold.test));
    structure.held_out.insert(structure.held_out.end(), losses.begin(), losses.end());
  }
  structure.score = robust(structure.held_out, segment_values());
}

Structure GapTrials::score(const FitResult& fit) const {
  Structure structure;
  structure.fit = fit;
  cross_score(model_, *linear_, structure);
  return structure;
}

void GapTrials::refine(std::vector<Structure>& structures, double from, double to) const {
  std::atomic<std::size_t> done{0};
  const auto count = static_cast<int>(structures.size());
  const int inner = std::max(1, settings_.jobs / std::max(1, count));
  parallel(structures.size(), settings_.jobs, [&](std::size_t i) {
    refine(structures[i], inner);
    const std::size_t now = ++done;
    if (progress_)
      progress_(from + (to - from) * static_cast<double>(now) / static_cast<double>(structures.size()),
                "comparing the best");
  });
}

Structure GapTrials::closure(const FitResult& base, const std::string& port) const {
  Structure all;
  all.fit.effects = base.effects;
  const auto add = [&](const Candidate& candidate) {
    Candidate start = candidate;
    const EffectType* type = find_effect_type(candidate.effect.effect);
    for (std::size_t p = 0; p < start.bounds.size(); ++p) {
      const double none = type->parameters[p].none;
      const Bounds& b = start.bounds[p];
      start.effect.parameters[p] =
          std::isnan(none) ? start.from_coordinate(p, 0.5) : std::clamp(none, b.minimum, b.maximum);
    }
    all.fit.effects.push_back(start);
  };
  const PortKind kind = sheet_.port(port).kind;
  bool flexible = false;
  for (const EffectType& type : effect_types()) {
    if (type.family != "flexible" || !type.fits_kind(kind)) continue;
    Candidate candidate;
    candidate.effect.effect = type.name;
    candidate.effect.port = port;
    candidate.family = type.family;
    for (const EffectParameter& parameter : type.parameters) {
      candidate.bounds.push_back({parameter.minimum, parameter.maximum});
      candidate.effect.parameters.push_back(parameter.none);
    }
    add(candidate);
    flexible = true;
  }
  if (!flexible)
    for (const Candidate& candidate : all_) {
      const bool there = std::any_of(base.effects.begin(), base.effects.end(), [&](const Candidate& known) {
        return known.effect.effect == candidate.effect.effect && known.effect.port == port;
      });
      if (!there && candidate.effect.port == port && candidate.family != "stuck" && candidate.family != "resolution")
        add(candidate);
    }
  all.fit.model = with_effects(all.fit.effects, base.model.parameters);
  return all;
}

std::vector<double> GapTrials::held_out(const GapModel& model) const {
  std::vector<double> result;
  for (const Fold& fold : folds_) {
    const Linearisation test = linear_->subset(fold.test);
    std::vector<Eigen::MatrixXf> residuals;
    for (const std::size_t run : fold.test) residuals.push_back(model_.residuals(model, run));
    const auto part = test.segment_losses(residuals);
    result.insert(result.end(), part.begin(), part.end());
  }
  return result;
}

double GapTrials::held_out_values() const {
  double count = 0;
  for (const Fold& fold : folds_)
    for (const std::size_t run : fold.test)
      count += static_cast<double>(model_.runs()[run].segments() * model_.segment() * model_.outputs().size());
  return count;
}

}  // namespace faultline
