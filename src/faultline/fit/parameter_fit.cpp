#include "faultline/fit/parameter_fit.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>

#include "faultline/fit/fit_errors.h"
#include "faultline/numerics/quantiles.h"
#include "faultline/numerics/random.h"
#include "faultline/segments/own_start.h"
#include "faultline/segments/segment_length.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

double scale_of(const Parameter& p, const FitOptions& options) {
  return p.tolerance > 0 ? p.tolerance : options.unmarked_tolerance_fraction;
}

std::vector<std::size_t> marked_parameters(const Datasheet& sheet) {
  std::vector<std::size_t> marked;
  for (std::size_t i = 0; i < sheet.parameters.size(); ++i) {
    if (!sheet.parameters[i].identify) continue;
    if (sheet.parameters[i].nominal == 0)
      throw InputError(fmt::format("{}: parameter {} is to be identified but its nominal value is 0; give it a scale",
                                   sheet.file, sheet.parameters[i].name));
    marked.push_back(i);
  }
  if (marked.empty())
    throw InputError(
        fmt::format("{}: no parameter is marked 'identify: true'; mark those that `fit` shall estimate", sheet.file));
  return marked;
}

using Enough = std::function<bool()>;  // never empty

struct Settled {
  double moved = 0;     // the largest move of the last round, in tolerances
  bool solved = false;  // the last round's search ended at a minimum
};

// Scatter and parameters in turn.
Settled settle(SegmentSolver& solver, std::vector<double>& values, const std::vector<std::size_t>& free,
               bool correlated, const FitOptions& options, const Enough& enough) {
  Settled last;
  for (std::size_t round = 0; round < options.rounds; ++round) {
    const std::vector<double> before = values;
    solver.set_scatter(values);
    if (correlated) {
      solver.set_correlation(values);
      solver.set_weights(values, free);
    }
    last.solved = solver.solve(values, free, round == 0 ? options.first_iterations : options.next_iterations);
    last.moved = 0;
    for (const std::size_t i : free)
      last.moved = std::max(last.moved, std::abs(solver.coordinate(i, values[i]) - solver.coordinate(i, before[i])));
    if ((last.solved && last.moved < options.settled_tolerances) || enough()) break;
  }
  return last;
}

// Other starts, drawn around the datasheet's values; `values` becomes the best. Returns how many ended lower.
// Where searches from elsewhere ended.
struct OtherStarts {
  std::size_t better = 0;                   // of them, that led on
  std::vector<std::vector<double>> passed;  // settled, not so good, or left for a better one
};

OtherStarts try_other_starts(SegmentSolver& solver, std::vector<double>& values, const std::vector<std::size_t>& free,
                             const FitOptions& options, const Enough& enough) {
  Random random(1);
  OtherStarts starts;
  solver.set_scatter(values);
  for (std::size_t s = 0; s < options.other_starts && !enough(); ++s) {
    std::vector<double> other = values;
    for (const std::size_t i : free) {
      const double least = solver.coordinate(i, options.lowest_ratio * solver.value(i, 0));
      const double most = solver.coordinate(i, options.highest_ratio * solver.value(i, 0));
      other[i] = solver.value(i, std::clamp(options.other_start_tolerances * random.normal(), least, most));
    }
    solver.solve(other, free, options.first_iterations);
    const double best = solver.cost(values, free);
    if (solver.cost(other, free) > (1 + options.near_cost_fraction) * best + options.alike_log_likelihood) continue;
    settle(solver, other, free, false, options, enough);
    solver.set_scatter(values);
    if (solver.cost(other, free) < (1 - options.better_cost_fraction) * solver.cost(values, free)) {
      std::swap(values, other);
      solver.set_scatter(values);
      ++starts.better;
    }
    starts.passed.push_back(other);
  }
  return starts;
}

double cost_at(SegmentSolver& solver, const std::vector<double>& values, const std::vector<std::size_t>& free) {
  solver.place_starts(values);
  return solver.cost(values, free);
}

// Answers elsewhere that fit as well as `values`, at its scatter and correlation.
std::vector<std::vector<double>> answers_alike(SegmentSolver& solver, const std::vector<double>& values,
                                               const std::vector<std::size_t>& free, const OtherStarts& starts,
                                               const FitOptions& options) {
  std::vector<std::vector<double>> alike;
  const double most = cost_at(solver, values, free) + options.alike_log_likelihood;
  for (const std::vector<double>& other : starts.passed)
    if (cost_at(solver, other, free) < most) alike.push_back(other);
  solver.place_starts(values);
  return alike;
}

// Hidden states follow the parameters, so that the cost around an answer, where they stand still, rises more steeply
// than along the valley in which they move along. Walks both ways along the direction that is known least: the
// parameter with the largest part in it is moved, all others and the states follow.
void walk_valley(SegmentSolver& solver, const FitErrors& errors, const std::vector<double>& values,
                 const std::vector<std::size_t>& free, const FitOptions& options,
                 std::vector<std::vector<double>>& alike, const Enough& enough) {
  if (!solver.has_hidden_states() || free.size() < 2) return;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> known(errors.curvature);
  const Eigen::VectorXd weakest = known.eigenvectors().rightCols(1);
  Eigen::Index leading = 0;
  weakest.cwiseAbs().maxCoeff(&leading);
  std::vector<std::size_t> others = free;
  others.erase(others.begin() + leading);
  const double most = cost_at(solver, values, free) + options.alike_log_likelihood;
  for (const double side : {-1.0, 1.0}) {
    std::vector<double> there = values;
    for (std::size_t step = 0; step < options.valley_steps && !enough(); ++step) {
      for (std::size_t j = 0; j < free.size(); ++j) {
        const double move =
            side * options.valley_step_tolerances * weakest[static_cast<Eigen::Index>(j)] / weakest[leading];
        there[free[j]] = solver.value(free[j], solver.coordinate(free[j], there[free[j]]) + move);
      }
      for (std::size_t round = 0; round < options.valley_rounds; ++round) {
        solver.place_starts(there);
        solver.solve(there, others, options.next_iterations);
      }
      if (cost_at(solver, there, free) > most) break;
      alike.push_back(there);
    }
  }
  solver.place_starts(values);
}

// The interval holds what other answers say; a parameter that they do not agree on is not determined.
void hold_answers(const std::vector<std::vector<double>>& alike, std::size_t index, FittedParameter& fitted) {
  const double half = 0.5 * (fitted.high - fitted.low);
  double farthest = 0, differing = 0;
  for (const std::vector<double>& other : alike) {
    const double off = std::abs(other[index] - fitted.estimate);
    if (off > farthest) {
      farthest = off;
      differing = other[index];
    }
    fitted.low = std::min(fitted.low, other[index]);
    fitted.high = std::max(fitted.high, other[index]);
  }
  if (!(farthest > 2 * half) || !fitted.determined) return;
  fitted.reason = fmt::format("another answer, {:.4g}, fits as well", differing);
  fitted.determined = false;
}

FittedParameter fitted_parameter(const Datasheet& sheet, const SegmentSolver& solver, const FitErrors& errors,
                                 const std::vector<double>& scales, const std::vector<double>& values,
                                 const std::vector<std::size_t>& free, std::size_t at, const FitOptions& options,
                                 const Enough& enough) {
  const std::size_t index = free[at];
  const auto i = static_cast<Eigen::Index>(at);
  const Parameter& p = sheet.parameters[index];
  FittedParameter fitted;
  fitted.name = p.name;
  fitted.unit = p.unit;
  fitted.nominal = p.nominal;
  fitted.tolerance = p.tolerance;
  fitted.estimate = values[index];
  fitted.statistical = errors.posterior[i] * scales[index];
  fitted.systematic = std::sqrt(errors.systematic[i]) * scales[index];
  const double half_width = std::hypot(student_ninety_percent(errors.freedom) * errors.posterior[i],
                                       kNinetyPercentSigmas * std::sqrt(errors.systematic[i]));
  Widening wider;
  if (errors.variance(i, i) + errors.systematic[i] > 1) {
    fitted.reason = reason_undetermined(sheet, scales, errors, free, at, options);
  } else if (!enough()) {
    // Beyond this the data do not know it to one tolerance.
    const double farthest = std::max(half_width, kNinetyPercentSigmas);
    wider = profile(solver, errors, values, free, at, half_width, farthest, options);
    if (std::max(wider.below, wider.above) * half_width >= farthest && farthest > half_width)
      fitted.reason =
          fmt::format("its curvature says +-{:.2g} tolerances, but a fit with it {} by a whole one is as good",
                      half_width, wider.below > wider.above ? "lower" : "higher");
  }
  fitted.determined = fitted.reason.empty();
  const double z = solver.coordinate(index, values[index]);
  fitted.low = solver.value(index, z - wider.below * half_width);
  fitted.high = solver.value(index, z + wider.above * half_width);
  if (fitted.low > fitted.high) std::swap(fitted.low, fitted.high);  // a negative value
  const double ratio = values[index] / p.nominal;
  fitted.at_bound = ratio < 1.001 * options.lowest_ratio || ratio > 0.999 * options.highest_ratio;
  return fitted;
}

}  // namespace

ParameterFit fit_parameters(const Datasheet& sheet, std::vector<std::pair<std::string, Recording>> runs, int jobs,
                            const FitProgress& progress, const FitOptions& options, const Enough& asked) {
  if (runs.empty()) throw InputError("fit: no run was given");
  const std::vector<std::size_t> free = marked_parameters(sheet);
  const SegmentModel model(sheet, options.segments);
  std::vector<const Recording*> recordings;
  for (const auto& run : runs) recordings.push_back(&run.second);
  const double segment = segment_length(sheet, recordings);
  std::vector<SegmentedRun> prepared;
  for (auto& [name, recording] : runs)
    prepared.push_back(cut_run(sheet, name, std::move(recording), segment, options.segments));
  need_readings(sheet, prepared);
  std::vector<std::string> remarks;
  if (std::string text = remark_of_own_start(sheet, segment); !text.empty()) remarks.push_back(std::move(text));
  const std::vector<double> noise = place_all(model, prepared);
  for (const SegmentedRun& run : prepared)
    if (!run.remark.empty()) remarks.push_back(run.remark);
  std::vector<double> scales;
  for (const Parameter& p : sheet.parameters) scales.push_back(scale_of(p, options));
  SegmentSolver solver(model, std::move(prepared), noise, scales, options, jobs);
  const auto tell = [&](const std::string& text) {
    if (progress) progress(text);
  };

  ParameterFit result;
  const Enough enough = [&] { return result.stopped = result.stopped || (asked && asked()); };
  result.values = sheet.nominal();
  const std::vector<double> before = solver.misfit(result.values);
  tell(fmt::format("{} parameters, {} segments", free.size(), solver.segments()));
  // Far from the minimum what is left is one long correlated error, which would hold the parameters where they are.
  settle(solver, result.values, free, false, options, enough);
  tell(fmt::format("{} other starts", options.other_starts));
  const OtherStarts starts = try_other_starts(solver, result.values, free, options, enough);
  const Settled last = settle(solver, result.values, free, true, options, enough);
  result.converged = last.solved && last.moved < options.settled_tolerances;
  std::vector<std::vector<double>> alike = answers_alike(solver, result.values, free, starts, options);
  tell("errors");
  const FitErrors errors = fit_errors(solver, sheet, result.values, free);
  walk_valley(solver, errors, result.values, free, options, alike, enough);
  for (std::size_t at = 0; at < free.size(); ++at) {
    tell(fmt::format("interval of {}", sheet.parameters[free[at]].name));
    result.parameters.push_back(
        fitted_parameter(sheet, solver, errors, scales, result.values, free, at, options, enough));
    hold_answers(alike, free[at], result.parameters.back());
  }
  const std::vector<double> after = solver.misfit(result.values), free_run = solver.free_misfit(result.values);
  for (std::size_t i = 0; i < model.outputs().size(); ++i) {
    const Channel& channel = sheet.channels[static_cast<std::size_t>(model.outputs()[i])];
    result.channels.push_back({channel.name, channel.unit, noise[i], before[i], after[i], free_run[i]});
  }
  result.segments = solver.segments();
  result.remarks = remarks;
  result.segment_duration = segment;
  result.freedom = errors.freedom;
  if (result.stopped)
    result.remarks.push_back(
        "stopped: rounds, other starts or the walls of intervals were left out; there may be a better answer, and "
        "intervals may be too narrow");
  if (!result.converged && !result.stopped)
    result.remarks.push_back(
        fmt::format("not converged: after {} rounds a parameter still moves by {:.2g} tolerances in a round; give more "
                    "or longer runs, or mark fewer parameters",
                    options.rounds, last.moved));
  if (starts.better > 0)
    result.remarks.push_back(
        fmt::format("{} of {} other starts ended at a better minimum than the datasheet's values did; check the "
                    "answer on another run",
                    starts.better, options.other_starts));
  if (errors.freedom < 10)
    result.remarks.push_back(
        fmt::format("few data: what is left is worth {:.2g} independent values beyond the parameters, and the "
                    "intervals are wider for it; give more or longer runs",
                    errors.freedom));
  std::string held;  // what has a tolerance and was not estimated may be what is off
  for (std::size_t i = 0; i < sheet.parameters.size(); ++i) {
    const Parameter& p = sheet.parameters[i];
    if (p.tolerance > 0 && p.nominal != 0 && std::find(free.begin(), free.end(), i) == free.end())
      held += (held.empty() ? "" : ", ") + p.name;
  }
  for (std::size_t i = 0; i < after.size(); ++i)
    if (after[i] > options.wrong_model_ratio * noise[i])
      result.remarks.push_back(fmt::format(
          "{}: what is left is {:.2g} times the noise; the model lacks something (faultline gap){}, and the "
          "estimates make up for it as far as they can",
          result.channels[i].channel, after[i] / noise[i],
          held.empty() ? "" : ", or a parameter is off that has a tolerance and is not estimated: " + held));
  for (const FittedParameter& p : result.parameters)
    if (p.at_bound)
      result.remarks.push_back(
          fmt::format("{} ended at its bound, {:.3g} of the datasheet's value", p.name, p.estimate / p.nominal));
  return result;
}

}  // namespace faultline
