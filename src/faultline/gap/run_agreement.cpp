#include "faultline/gap/run_agreement.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include <fmt/format.h>
#include <Eigen/LU>

#include "faultline/attribution/screening.h"
#include "faultline/gap/gap_trials.h"
#include "faultline/numerics/in_parallel.h"

namespace faultline {
namespace {

struct OwnParameters {
  std::size_t run = 0;
  std::vector<double> values;
  Eigen::VectorXd z, variance;  // of the free ones, in tolerances
  double loss = 0, gain = 0;    // with the common parameters; and what its own win
};

std::vector<double> robust_losses(const Linearisation& linear, const std::vector<Eigen::MatrixXf>& residuals) {
  std::vector<double> result = linear.segment_losses(residuals);
  for (double& loss : result) loss = linear.robust(loss);
  return result;
}

double loss_of(const Linearisation& linear) { return sum(robust_losses(linear, linear.at_model())); }

// From common parameters, which lie between those of the runs, one linearisation does not lead to a run's own.
OwnParameters fitted_alone(const ResidualModel& residuals, std::size_t run, const FitResult& at) {
  const GapOptions::Agreement& options = residuals.options().agreement;
  std::vector<Candidate> held = at.effects;
  for (Candidate& effect : held)
    for (std::size_t p = 0; p < effect.bounds.size(); ++p)
      effect.bounds[p].minimum = effect.bounds[p].maximum = effect.effect.parameters[p];
  ResidualModel alone = residuals.only(run);
  ModelChange model = at.model;
  auto linear = std::make_unique<Linearisation>(alone, model, std::vector<std::size_t>{0}, 1);
  OwnParameters own;
  own.run = run;
  own.loss = loss_of(*linear);
  double least = own.loss;
  for (std::size_t round = 0; round < options.rounds; ++round) {
    const FitResult fit = fit_gap(alone, model, held, *linear, residuals.options().trials.steps);
    alone.settle_starts(fit.model, 0);
    auto there = std::make_unique<Linearisation>(alone, fit.model, std::vector<std::size_t>{0}, 1);
    const double now = loss_of(*there), gained = least - now;
    if (!(gained > 0)) break;
    model = fit.model;
    linear = std::move(there);
    least = now;
    if (gained < options.settled_gain_fraction * (own.loss - least)) break;
  }
  own.gain = own.loss - least;
  own.values = model.parameters;
  own.z = deviations(residuals.sheet(), linear->free_parameters(), own.values);
  const Eigen::Index n = own.z.size();
  Eigen::MatrixXd information = Eigen::MatrixXd::Identity(n, n);
  std::size_t segment = 0;
  for (const Eigen::MatrixXd& products : linear->products(linear->at_model()))
    information += linear->weights()[segment++] * products.block(1, 1, n, n);
  own.variance = information.inverse().diagonal();
  return own;
}

}  // namespace

std::string disagreement(const ResidualModel& residuals, const Linearisation& linear, const FitResult& at, int jobs) {
  const GapOptions::Agreement& options = residuals.options().agreement;
  const double values = linear.segment_values() * static_cast<double>(linear.weights().size());
  const double least_gain = options.least_excess_variances * 0.5 * values;
  if (loss_of(linear) < least_gain) return "";  // what is left beyond the noise is less
  std::vector<OwnParameters> runs(linear.runs().size());
  in_parallel(runs.size(), jobs, [&](std::size_t r) { runs[r] = fitted_alone(residuals, linear.runs()[r], at); });
  double gain = 0, loss = 0;
  for (const OwnParameters& run : runs) {
    gain += run.gain;
    loss += run.loss;
  }
  if (gain < options.gain_fraction * loss || gain < least_gain) return "";
  double farthest = options.apart_standard_errors;
  std::string text;
  for (std::size_t a = 0; a < runs.size(); ++a)
    for (std::size_t b = a + 1; b < runs.size(); ++b)
      for (Eigen::Index i = 0; i < runs[a].z.size(); ++i) {
        const double apart = std::abs(runs[a].z[i] - runs[b].z[i]);
        const double errors = apart / std::sqrt(runs[a].variance[i] + runs[b].variance[i]);
        if (errors <= farthest || apart < options.apart_tolerances) continue;
        farthest = errors;
        const std::size_t index = linear.free_parameters()[static_cast<std::size_t>(i)];
        const Parameter& parameter = residuals.sheet().parameters[index];
        text = fmt::format(
            "the runs disagree: with parameters of its own each run loses {:.0f} % of its gap; {} is {:.4g} {} in {} "
            "and "
            "{:.4g} {} in {}. Are they of one rig, in one state?",
            100 * gain / loss, parameter.name, runs[a].values[index], parameter.unit,
            residuals.runs()[runs[a].run].name, runs[b].values[index], parameter.unit,
            residuals.runs()[runs[b].run].name);
      }
  return text;
}

}  // namespace faultline
