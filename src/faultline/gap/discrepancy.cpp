#include "faultline/gap/discrepancy.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "faultline/numerics/in_parallel.h"

namespace faultline {
namespace {

constexpr int kReferences = 2;                     // times that the model is made linear around a better course
constexpr int kExpectations = 4;                   // steps of EM around each
constexpr double kLeastVariance = 1e-18;           // of the process noise, in sizes squared
constexpr double kWeakest = 1e-7, kStrongest = 1;  // levels of a free signal that are tried, in the port's unit

double total(const std::vector<double>& losses) { return std::accumulate(losses.begin(), losses.end(), 0.0); }

// The likeliest level and memory of a free signal at a port.
FreePlace best_signal(const StochasticModel& model, const GatheredRows& rows, const Eigen::VectorXd& q, double before,
                      std::size_t port) {
  FreeSignal signal;
  signal.port = static_cast<int>(port);
  signal.memory = 0.3 * static_cast<double>(model.block) * model.step;
  FreePlace best;
  best.port = model.ports[port];
  FreeSignal at = signal;
  double least = before;
  const auto attempt = [&](double level, double memory) {
    FreeSignal tried = signal;
    tried.level = level;
    tried.memory = memory;
    const double loss = total(block_losses(model, rows, q, tried));
    if (!(loss < least)) return false;
    least = loss;
    at = tried;
    return true;
  };
  for (double level = kWeakest; level <= kStrongest; level *= 10) attempt(level, signal.memory);
  if (at.level == 0) return best;
  const double middle = signal.memory;
  for (const double ratio : {0.1, 10.0, 100.0})
    for (const double size : {0.3, 1.0, 3.0}) attempt(size * at.level, ratio * middle);
  for (double step = 2; step > 1.1; step = std::sqrt(step))
    while (attempt(at.level * step, at.memory) || attempt(at.level / step, at.memory)) {
    }
  best.level = at.level * model.unit[port];
  best.memory = at.memory;
  best.gain = before - least;
  return best;
}

}  // namespace

FittedProcess fit_process(const ResidualModel& residuals, const ModelChange& change,
                          const std::vector<std::size_t>& runs, int jobs) {
  StochasticModel model = stochastic_model(residuals, change, runs, jobs);
  const Eigen::Index states = model.size.size();
  Eigen::VectorXd q = Eigen::VectorXd::Constant(states, kLeastVariance);
  double count = 0;
  for (const StochasticStretch& stretch : model.stretches)
    for (const Eigen::VectorXd& defect : stretch.defect) {
      if (defect.allFinite()) q += defect.cwiseAbs2();
      count += 1;
    }
  q /= std::max(1.0, count);
  for (int reference = 0; reference <= kReferences; ++reference) {
    Smoothing course;
    for (int i = 0; i < kExpectations; ++i) {
      course = smooth(model, q, {});
      q = course.q.cwiseMax(kLeastVariance);
    }
    if (reference < kReferences) move_reference(residuals, change, course.states, jobs, model);
  }
  return {std::move(model), std::move(q)};
}

Discrepancy find_discrepancy(const ResidualModel& residuals, const ModelChange& change,
                             const std::vector<std::size_t>& runs, int jobs, Places places) {
  FittedProcess process = fit_process(residuals, change, runs, jobs);
  StochasticModel& model = process.model;
  const Eigen::VectorXd& q = process.q;
  Discrepancy result;
  const GatheredRows rows = gather(model);
  result.losses = block_losses(model, rows, q, {});
  result.loss = total(result.losses);
  for (const StochasticStretch& stretch : model.stretches)
    for (const Eigen::VectorXd& misfit : stretch.misfit)
      result.readings += static_cast<double>((misfit.array() == misfit.array()).count());
  for (Eigen::Index s = 0; s < q.size(); ++s) result.noise.push_back(model.size[s] * std::sqrt(q[s]));
  if (places == Places::none) return result;
  open_ports(residuals, change, jobs, model);
  result.places.resize(model.ports.size());
  in_parallel(model.ports.size(), jobs,
              [&](std::size_t p) { result.places[p] = best_signal(model, rows, q, result.loss, p); });
  std::stable_sort(result.places.begin(), result.places.end(),
                   [](const FreePlace& a, const FreePlace& b) { return a.gain > b.gain; });
  return result;
}

bool restarts_freely(const EffectSpec& effect) {
  const PortKind kind = port_kind(effect.port);
  if (kind == PortKind::line || kind == PortKind::transmission) return false;
  return kind != PortKind::sensor || !find_effect_type(effect.effect)->make()->remembers();
}

}  // namespace faultline
