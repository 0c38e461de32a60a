#include "faultline/gap/screening.h"

#include <algorithm>
#include <atomic>

#include "faultline/attribution/fault_hypothesis.h"
#include "faultline/attribution/screening.h"
#include "faultline/numerics/in_parallel.h"

namespace faultline {
namespace {

constexpr std::size_t kTogether = 32;  // models that run beside one: their residuals are held at once

FitResult beside(const FitResult& base, const Candidate& candidate, const std::vector<double>& values) {
  FitResult fit;
  fit.effects = base.effects;
  fit.effects.push_back(candidate);
  fit.effects.back().effect.parameters = values;
  fit.model = with_effects(fit.effects, base.model.parameters);
  return fit;
}

bool has(const std::vector<Candidate>& effects, const Candidate& candidate) {
  return std::any_of(effects.begin(), effects.end(),
                     [&](const Candidate& known) { return same_effect(known, candidate); });
}

// The first trials, many beside one run of the base (SegmentModel::residuals); what cannot go beside it runs alone.
template <class Judge>
void try_first(const ResidualModel& residuals, const std::vector<std::size_t>& runs,
               const std::vector<Candidate>& candidates, const std::vector<Trial>& trials,
               const std::vector<std::vector<double>>& values, const FitResult& base, int jobs, Judge&& judge) {
  std::vector<std::size_t> firsts;
  for (std::size_t i = 0; i < trials.size(); ++i)
    if (trials[i].first) firsts.push_back(i);
  // What acts in the equations needs the model's derivatives in every step: not beside what only sensors show.
  std::stable_partition(firsts.begin(), firsts.end(), [&](std::size_t i) {
    return port_kind(candidates[trials[i].hypothesis].effect.port) == PortKind::sensor;
  });
  in_parallel((firsts.size() + kTogether - 1) / kTogether, jobs, [&](std::size_t batch) {
    const std::size_t first = batch * kTogether, count = std::min(kTogether, firsts.size() - first);
    std::vector<ModelChange> tried;
    for (std::size_t k = first; k < first + count; ++k)
      tried.push_back(beside(base, candidates[trials[firsts[k]].hypothesis], values[firsts[k]]).model);
    std::vector<std::vector<Eigen::MatrixXf>> full(count);
    for (const std::size_t r : runs) {
      const SegmentedRun& run = residuals.runs()[r];
      std::vector<SegmentModel::Variant> variants{{&base.model, starts_of(run)}};
      for (const ModelChange& change : tried) variants.push_back({&change, variants.front().starts});
      std::vector<Eigen::MatrixXf> found = residuals.model().residuals(variants, run, residuals.noise(), 1);
      for (std::size_t k = 0; k < count; ++k) full[k].push_back(std::move(found[1 + k]));
    }
    for (std::size_t k = 0; k < count; ++k) judge(firsts[first + k], full[k]);
  });
}

}  // namespace

std::vector<Structure> screen_candidates(const ResidualModel& residuals, const Linearisation& linear,
                                         const std::vector<Candidate>& candidates, const FitResult& base, int jobs,
                                         const std::function<void(double)>& progress) {
  const GapOptions::Screening& options = residuals.options().screening;
  std::vector<Trial> trials;
  std::vector<std::vector<double>> values;
  for (std::size_t c = 0; c < candidates.size(); ++c) {
    if (has(base.effects, candidates[c])) continue;
    const auto points = starting_points(candidates[c], residuals.options().candidates);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const bool first = i % options.first_stride == options.first_stride / 2 || points.size() == 1;
      trials.push_back({c, first});
      values.push_back(points[i]);
    }
  }
  const Eigen::VectorXd z = deviations(residuals.sheet(), linear.free_parameters(), base.model.parameters);
  const double before = adjusted(linear, linear.products(linear.at_model()), z).loss;
  std::vector<Adjusted> found(trials.size());
  std::atomic<std::size_t> done{0};
  const auto judge = [&](std::size_t i, const std::vector<Eigen::MatrixXf>& full) {
    const std::vector<Eigen::MatrixXd> products =
        linear.products(linear.at_model(), {difference(full, linear.at_model(), 1)});
    // The loss has a valley where segments turn quiet, from both ends.
    found[i] = adjusted(linear, products, z, 1);
    Adjusted small = adjusted(linear, products, z, options.least_size_fraction);
    if (small.loss < found[i].loss) found[i] = std::move(small);
    if (progress) progress(static_cast<double>(++done) / static_cast<double>(trials.size()));
  };
  try_first(residuals, linear.runs(), candidates, trials, values, base, jobs, judge);
  const auto loss = [&](std::size_t i, double) {
    if (!trials[i].first)
      judge(i, residuals_of(residuals, beside(base, candidates[trials[i].hypothesis], values[i]).model, linear.runs()));
    return found[i].loss;
  };
  std::vector<Structure> result;
  for (const std::size_t i : try_sizes(trials, options.followed_candidates, jobs, loss)) {
    const Candidate& candidate = candidates[trials[i].hypothesis];
    // Of an effect that was tried at several lines of a spectrum only the best.
    if (std::any_of(result.begin(), result.end(),
                    [&](const Structure& better) { return same_effect(better.fit.effects.back(), candidate); }))
      continue;
    FitResult fit = beside(base, candidate, values[i]);
    EffectSpec& effect = fit.effects.back().effect;
    if (candidate.family != "stuck") effect.parameters = scaled(effect, found[i].fraction);  // a time is no size
    for (std::size_t p = 0; p < effect.parameters.size(); ++p)
      effect.parameters[p] = std::clamp(effect.parameters[p], candidate.bounds[p].minimum, candidate.bounds[p].maximum);
    fit.model = with_effects(fit.effects, base.model.parameters);
    shift_parameters(residuals, linear.free_parameters(), found[i].move, fit.model.parameters);
    result.emplace_back();
    result.back().fit = std::move(fit);
    result.back().screened = before - found[i].loss;
  }
  return result;
}

}  // namespace faultline
