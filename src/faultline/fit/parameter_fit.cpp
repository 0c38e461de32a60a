#include "faultline/fit/parameter_fit.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Cholesky>

#include "faultline/fit/segment_solver.h"
#include "faultline/numerics/quantiles.h"
#include "faultline/segments/time_scales.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kRidge = 1e-9;  // added to the Hessian's diagonal: a guard against what no run shows

double scale_of(const Parameter& p, const FitOptions& options) {
  return p.tolerance > 0 ? p.tolerance : options.unmarked_tolerance_fraction;
}

struct Marked {
  std::size_t index;
  bool free = true;
  std::string reason;
};

// Errors of the free parameters, in tolerances.
struct Errors {
  Eigen::MatrixXd statistical, systematic;
  Eigen::VectorXd conditional;  // with all others known
};

Errors errors_of(const SegmentSolver& solver, const Datasheet& sheet, const std::vector<double>& values,
                 const std::vector<std::size_t>& free) {
  Errors e;
  const SegmentSolver::Information info = solver.information(values, free);
  const Eigen::Index n = info.hessian.rows();
  const Eigen::LDLT<Eigen::MatrixXd> factor(info.hessian + kRidge * Eigen::MatrixXd::Identity(n, n));
  const Eigen::MatrixXd inverse = factor.solve(Eigen::MatrixXd::Identity(n, n));
  e.statistical = inverse * info.scatter * inverse;
  e.conditional.resize(n);
  for (Eigen::Index i = 0; i < n; ++i)
    e.conditional[i] = std::sqrt(info.scatter(i, i)) / std::max(info.hessian(i, i), 1e-12);
  std::vector<SegmentSolver::Change> changes;
  for (std::size_t i = 0; i < sheet.parameters.size(); ++i) {
    if (sheet.parameters[i].tolerance <= 0 || std::find(free.begin(), free.end(), i) != free.end()) continue;
    std::vector<double> plus = values, minus = values;
    plus[i] *= 1 + 0.5 * sheet.parameters[i].tolerance;
    minus[i] *= 1 - 0.5 * sheet.parameters[i].tolerance;
    changes.push_back({{plus, {}}, {minus, {}}});
  }
  for (const std::string& text : sheet.nuisance) changes.push_back({{values, {parse_effect(text)}}, {values, {}}});
  const Eigen::MatrixXd shifts = inverse * solver.responses(values, free, changes);
  e.systematic = shifts * shifts.transpose();
  return e;
}

std::string reason_for(const Datasheet& sheet, const std::vector<std::size_t>& free, const Errors& e,
                       Eigen::Index worst, const FitOptions& options) {
  const Eigen::MatrixXd total = e.statistical + e.systematic;
  if (e.conditional[worst] > options.seen_error_tolerances)
    return fmt::format("these runs hardly respond to it: alone it would be known to {:.2g} tolerances",
                       e.conditional[worst]);
  std::string with;
  for (Eigen::Index j = 0; j < total.rows(); ++j) {
    if (j == worst) continue;
    const double correlation = e.statistical(worst, j) / std::sqrt(e.statistical(worst, worst) * e.statistical(j, j));
    if (std::abs(correlation) < options.named_correlation) continue;
    with += (with.empty() ? "" : ", ") +
            fmt::format("{} ({:+.2f})", sheet.parameters[free[static_cast<std::size_t>(j)]].name, correlation);
  }
  if (!with.empty()) return "only a combination is determined; correlated with " + with;
  if (e.systematic(worst, worst) > e.statistical(worst, worst))
    return "what else may be off in the model (tolerances, nuisance effects) moves it by more than its tolerance";
  return "these runs are too short or too poorly explained to know it better than the datasheet";
}

}  // namespace

ParameterFit fit_parameters(const Datasheet& sheet, std::vector<std::pair<std::string, Recording>> runs, int jobs,
                            const FitProgress& progress, const FitOptions& options) {
  if (runs.empty()) throw InputError("fit: no run was given");
  std::vector<Marked> marked;
  for (std::size_t i = 0; i < sheet.parameters.size(); ++i)
    if (sheet.parameters[i].identify) {
      if (sheet.parameters[i].nominal == 0)
        throw InputError(fmt::format("{}: parameter {} is to be identified but its nominal value is 0; give it a scale",
                                     sheet.file, sheet.parameters[i].name));
      marked.push_back({i, true, ""});
    }
  if (marked.empty())
    throw InputError(
        fmt::format("{}: no parameter is marked 'identify: true' or has a tolerance; mark those that `fit` shall estimate", sheet.file));
  const SegmentModel model(sheet, options.segments);
  std::vector<const Recording*> recordings;
  for (const auto& run : runs) recordings.push_back(&run.second);
  const double segment = segment_length(sheet, recordings);
  std::vector<SegmentedRun> prepared;
  for (auto& [name, recording] : runs)
    prepared.push_back(cut_run(sheet, name, std::move(recording), segment, options.segments));
  const std::vector<double> noise = noise_of(sheet, prepared, options.segments);
  for (SegmentedRun& run : prepared) model.place_starts(run, noise, model.nominal());
  std::vector<double> scales;
  for (const Parameter& p : sheet.parameters) scales.push_back(scale_of(p, options));
  SegmentSolver solver(model, std::move(prepared), noise, scales, options, jobs);
  const auto tell = [&](const std::string& text) {
    if (progress) progress(text);
  };

  ParameterFit result;
  result.values = sheet.nominal();
  const std::vector<double> before = solver.misfit(result.values);
  Errors errors;
  std::vector<std::size_t> free;
  bool first = true;
  while (true) {
    free.clear();
    for (const Marked& m : marked)
      if (m.free) free.push_back(m.index);
    if (free.empty()) break;
    tell(fmt::format("{} parameters, {} segments", free.size(), solver.segments()));
    // Scatter and parameters in turn.
    solver.set_scatter(result.values);
    solver.solve(result.values, free, first ? options.first_iterations : options.next_iterations);
    solver.set_scatter(result.values);
    solver.solve(result.values, free, options.next_iterations);
    first = false;
    errors = errors_of(solver, sheet, result.values, free);
    // The worst of those that are not determined goes; the others may be determined without it.
    Eigen::Index worst = -1;
    double largest = 1;
    for (Eigen::Index j = 0; j < errors.statistical.rows(); ++j) {
      const double error = std::sqrt(errors.statistical(j, j) + errors.systematic(j, j));
      if (error > largest) {
        largest = error;
        worst = j;
      }
    }
    if (worst < 0) break;
    const std::size_t index = free[static_cast<std::size_t>(worst)];
    const auto place = std::find_if(marked.begin(), marked.end(), [&](const Marked& m) { return m.index == index; });
    place->free = false;
    place->reason = reason_for(sheet, free, errors, worst, options);
    tell(fmt::format("{} is not determined", sheet.parameters[index].name));
    result.values[index] = sheet.parameters[index].nominal;
  }

  for (const Marked& m : marked) {
    const Parameter& p = sheet.parameters[m.index];
    FittedParameter fitted;
    fitted.name = p.name;
    fitted.unit = p.unit;
    fitted.nominal = p.nominal;
    fitted.tolerance = p.tolerance;
    fitted.determined = m.free;
    fitted.reason = m.reason;
    fitted.estimate = result.values[m.index];
    double error = scale_of(p, options) * p.nominal;  // of the estimate, in its unit
    if (m.free) {
      const Eigen::Index at = std::find(free.begin(), free.end(), m.index) - free.begin();
      fitted.statistical = std::sqrt(errors.statistical(at, at)) * error / fitted.estimate;
      fitted.systematic = std::sqrt(errors.systematic(at, at)) * error / fitted.estimate;
      error *= std::sqrt(errors.statistical(at, at) + errors.systematic(at, at));
    }
    fitted.low = fitted.estimate - kNinetyPercentSigmas * std::abs(error);
    fitted.high = fitted.estimate + kNinetyPercentSigmas * std::abs(error);
    result.parameters.push_back(fitted);
  }
  const std::vector<double> after = solver.misfit(result.values);
  for (std::size_t i = 0; i < model.outputs().size(); ++i) {
    const Channel& channel = sheet.channels[static_cast<std::size_t>(model.outputs()[i])];
    result.channels.push_back({channel.name, channel.unit, noise[i], before[i], after[i]});
  }
  result.segments = solver.segments();
  result.segment_duration = segment;
  return result;
}

}  // namespace faultline
