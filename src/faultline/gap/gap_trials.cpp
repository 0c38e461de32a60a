#include "faultline/gap/gap_trials.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>

namespace faultline {
namespace {

constexpr double kSamplesCorrelate = 20;  // samples of a misfit that say the same

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

FitResult GapTrials::refit(const GapModel& start, const std::vector<Candidate>& effects, int rounds) {
  FitResult fit;
  fit.model = start;
  fit.effects = effects;
  for (int round = 0; round < rounds; ++round) {
    linear_ = std::make_unique<Linearisation>(model_, with(fit.effects, fit.model.parameters), every_, settings_.jobs);
    fit = fit_gap(model_, fit.model, fit.effects, linear_->subset(learn_), 3);
  }
  linear_ = std::make_unique<Linearisation>(model_, with(fit.effects, fit.model.parameters), every_, settings_.jobs);
  return fit;
}

std::vector<Scored> GapTrials::screen(const FitResult& base, double from, double to) {
  struct Point {
    std::size_t candidate;
    std::vector<double> values;
    double loss = 0;
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
  const double before = projected_loss(*linear_, linear_->at_model(), z);
  std::atomic<std::size_t> done{0};
  parallel(points.size(), settings_.jobs, [&](std::size_t i) {
    std::vector<Candidate> effects = base.effects;
    effects.push_back(all_[points[i].candidate]);
    effects.back().effect.parameters = points[i].values;
    const GapModel model = with(effects, base.model.parameters);
    std::vector<Eigen::MatrixXf> residuals;
    for (const std::size_t run : every_) residuals.push_back(model_.residuals(model, run));
    points[i].loss = projected_loss(*linear_, residuals, z);
    const std::size_t now = ++done;
    if (progress_)
      progress_(from + (to - from) * static_cast<double>(now) / static_cast<double>(points.size()), "trying effects");
  });
  std::vector<Scored> result;
  for (std::size_t c = 0; c < all_.size(); ++c) {
    const Point* best = nullptr;
    for (const Point& point : points)
      if (point.candidate == c && (!best || point.loss < best->loss)) best = &point;
    if (!best) continue;
    Scored scored;
    scored.effects = base.effects;
    scored.effects.push_back(all_[c]);
    scored.effects.back().effect.parameters = best->values;
    scored.screened = before - best->loss;
    result.push_back(std::move(scored));
  }
  std::stable_sort(result.begin(), result.end(),
                   [](const Scored& a, const Scored& b) { return a.screened > b.screened; });
  return result;
}

void GapTrials::score(const FitResult& base, std::vector<Scored>& structures, double from, double to) {
  const std::size_t parts = folds_.size() + 1;
  std::vector<Linearisation> train, test;
  for (const Fold& fold : folds_) {
    train.push_back(linear_->subset(fold.train));
    test.push_back(linear_->subset(fold.test));
  }
  const Linearisation learn = linear_->subset(learn_);
  std::vector<std::vector<double>> losses(structures.size() * folds_.size());
  std::atomic<std::size_t> done{0};
  parallel(structures.size() * parts, settings_.jobs, [&](std::size_t i) {
    Scored& structure = structures[i / parts];
    const std::size_t part = i % parts;
    if (part == folds_.size()) {
      structure.everywhere = fit_gap(model_, base.model, structure.effects, learn, 8);
    } else {
      const FitResult fit = fit_gap(model_, base.model, structure.effects, train[part], 8);
      std::vector<Eigen::MatrixXf> residuals;
      for (const std::size_t run : folds_[part].test) residuals.push_back(model_.residuals(fit.model, run));
      losses[i / parts * folds_.size() + part] = test[part].segment_losses(residuals);
    }
    const std::size_t now = ++done;
    if (progress_)
      progress_(from + (to - from) * static_cast<double>(now) / static_cast<double>(structures.size() * parts),
                "fitting the best");
  });
  for (std::size_t s = 0; s < structures.size(); ++s) {
    structures[s].held_out.clear();
    for (std::size_t f = 0; f < folds_.size(); ++f) {
      const auto& part = losses[s * folds_.size() + f];
      structures[s].held_out.insert(structures[s].held_out.end(), part.begin(), part.end());
    }
    structures[s].score = robust(structures[s].held_out, segment_values());
  }
}

Scored GapTrials::closure(const FitResult& base, const std::string& port) const {
  Scored all;
  for (const Candidate& candidate : all_) {
    if (candidate.effect.port != port || candidate.family == "stuck" || candidate.family == "resolution") continue;
    Candidate start = candidate;
    const EffectType* type = find_effect_type(candidate.effect.effect);
    for (std::size_t p = 0; p < start.bounds.size(); ++p) {
      const double none = type->parameters[p].none;
      const Bounds& b = start.bounds[p];
      start.effect.parameters[p] =
          std::isnan(none) ? start.from_coordinate(p, 0.5) : std::clamp(none, b.minimum, b.maximum);
    }
    for (const Candidate& known : base.effects)
      if (known.effect.effect == start.effect.effect && known.effect.port == port) start = known;
    all.effects.push_back(start);
  }
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

GapModel GapTrials::with(const std::vector<Candidate>& effects, const std::vector<double>& parameters) {
  GapModel model;
  model.parameters = parameters;
  for (const Candidate& candidate : effects) model.effects.push_back(candidate.effect);
  return model;
}

}  // namespace faultline
