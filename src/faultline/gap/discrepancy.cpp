#include "faultline/gap/discrepancy.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "faultline/gap/signal_scan.h"
#include "faultline/numerics/in_parallel.h"

namespace faultline {
namespace {

constexpr int kReferences = 2;            // times that the model is made linear around a better course
constexpr int kExpectations = 4;          // steps of EM around each
constexpr double kLeastVariance = 1e-18;  // of the process noise, in sizes squared
constexpr double kAlike = 2;              // log likelihood, up to which two places are not told apart
constexpr double kNear = 0.95;            // of the likeliest place's gain, from which another may be the same
// Of a level or a memory: within it the likelihood of a signal of some hundred values changes by less than one.
constexpr double kLeastStep = 1.1;
constexpr std::size_t kPolished = 6;  // places whose free signal is fitted by the filter itself

double total(const std::vector<double>& losses) { return std::accumulate(losses.begin(), losses.end(), 0.0); }

// The likeliest level and memory of a free signal at a port, from where the scan found it on. `ridge`: also where both
// change so that it moves as far in a step, which is what the filter sees least of.
FreePlace best_signal(const StochasticModel& model, const Eigen::VectorXd& q, double before, const FreeSignal& from,
                      bool ridge) {
  FreeSignal at = from;
  at.level = 0;
  double least = before;
  const auto attempt = [&](double level, double memory) {
    FreeSignal tried = from;
    tried.level = level;
    tried.memory = memory;
    const double loss = total(block_losses(model, q, tried));
    if (!(loss < least)) return false;
    least = loss;
    at = tried;
    return true;
  };
  for (const double ratio : {1.0, 10.0, 0.1}) attempt(ratio * from.level, from.memory);
  if (at.level > 0)
    for (double step = 3; step > kLeastStep; step = std::sqrt(step)) {
      while (attempt(at.level * step, at.memory) || attempt(at.level / step, at.memory)) {
      }
      while (attempt(at.level, at.memory * step) || attempt(at.level, at.memory / step)) {
      }
      const double root = std::sqrt(step);
      while (ridge && (attempt(at.level * root, at.memory * step) || attempt(at.level / root, at.memory / step))) {
      }
    }
  const auto port = static_cast<std::size_t>(from.port);
  return {model.ports[port], at.level * model.unit[port], at.memory, before - least};
}

// What a signal of one unit at a port does to the states in each step: states x steps per stretch.
std::vector<Eigen::MatrixXd> drives_of(const StochasticModel& model, const std::string& name) {
  const auto found = std::find(model.ports.begin(), model.ports.end(), name);
  if (found == model.ports.end()) return {};
  const auto port = static_cast<std::size_t>(found - model.ports.begin());
  std::vector<Eigen::MatrixXd> drives;
  for (const StochasticStretch& stretch : model.stretches)
    drives.push_back(stretch.port_drives[port] / model.unit[port]);
  return drives;
}

// A state more: noise of a transducer that has a memory, in units of its level. An output's is read with it, an input's
// drives the model; `drives`: drives_of() its port, empty where it moves nothing.
void let_in(const ResidualModel& residuals, const FreePlace& noise, const std::vector<Eigen::MatrixXd>& drives,
            StochasticModel& model, Eigen::VectorXd& q) {
  const std::optional<std::size_t> output = output_of(residuals, noise.port);
  const Eigen::Index n = q.size();
  const double keep = std::exp(-model.step / noise.memory);
  q.conservativeResize(n + 1);
  q[n] = 1 - keep * keep;
  model.size.conservativeResize(n + 1);
  model.size[n] = 1;
  for (std::size_t s = 0; s < model.stretches.size(); ++s) {
    StochasticStretch& stretch = model.stretches[s];
    for (std::size_t i = 0; i < stretch.f.size(); ++i) {
      Eigen::MatrixXd& f = stretch.f[i];
      f.conservativeResize(n + 1, n + 1);
      f.row(n).setZero();
      f.col(n).setZero();
      if (!drives.empty() && drives[s].size() > 0)
        f.col(n).head(drives[s].rows()) = noise.level * drives[s].col(static_cast<Eigen::Index>(i));
      f(n, n) = keep;
    }
    for (Eigen::MatrixXd& h : stretch.h) {
      h.conservativeResize(Eigen::NoChange, n + 1);
      h.col(n).setZero();
      if (output) h(static_cast<Eigen::Index>(*output), n) = noise.level / residuals.noise()[*output];
    }
    for (Eigen::VectorXd& defect : stretch.defect) {
      defect.conservativeResize(n + 1);
      defect[n] = 0;
    }
    for (Eigen::VectorXd& bend : stretch.bend) {
      bend.conservativeResize(n + 1);
      bend[n] = 0;
    }
    for (Eigen::MatrixXd& drive : stretch.port_drives) {
      if (drive.size() == 0) continue;
      drive.conservativeResize(n + 1, Eigen::NoChange);
      drive.row(n).setZero();
    }
  }
}

bool by_gain(const FreePlace& a, const FreePlace& b) { return a.gain > b.gain; }

// What a free signal at each port wins, best first: the scan's word, and the filter's for the few that stand out.
std::vector<FreePlace> free_places(const StochasticModel& model, const Eigen::VectorXd& q, double loss, int jobs) {
  std::vector<ScannedSignal> scanned = scan_signals(model, q, jobs);
  std::stable_sort(scanned.begin(), scanned.end(),
                   [](const ScannedSignal& a, const ScannedSignal& b) { return a.gain > b.gain; });
  std::vector<FreePlace> places(scanned.size());
  const std::size_t few = std::min(kPolished, places.size());
  in_parallel(few, jobs, [&](std::size_t i) { places[i] = best_signal(model, q, loss, scanned[i].signal, false); });
  std::stable_sort(places.begin(), places.begin() + static_cast<std::ptrdiff_t>(few), by_gain);
  // What enters with a command goes on through the place that it drives: where both win alike, that place is told,
  // since a cause there may depend on more than the command.
  const auto is_command = [](const FreePlace& place) { return port_kind(place.port) == PortKind::command; };
  const auto driven = std::find_if_not(places.begin(), places.begin() + static_cast<std::ptrdiff_t>(few), is_command);
  if (driven != places.begin() + static_cast<std::ptrdiff_t>(few) && driven->gain > places.front().gain - kAlike)
    std::rotate(places.begin(), driven, driven + 1);
  // The first, and transducers that are nearly as likely: whether one of these is the same place is asked of them.
  const double near = few > 0 ? kNear * places.front().gain : 0;
  for (std::size_t i = 0; i < few; ++i) {
    FreePlace& place = places[i];
    if (!(place.gain > 0) || (i > 0 && (port_kind(place.port) != PortKind::sensor || place.gain < near))) continue;
    const auto port =
        static_cast<std::size_t>(std::find(model.ports.begin(), model.ports.end(), place.port) - model.ports.begin());
    place = best_signal(model, q, loss, {static_cast<int>(port), place.level / model.unit[port], place.memory}, true);
  }
  for (std::size_t i = few; i < places.size(); ++i) {
    const ScannedSignal& s = scanned[i];
    const auto port = static_cast<std::size_t>(s.signal.port);
    places[i] = {model.ports[port], s.signal.level * model.unit[port], s.signal.memory,
                 std::min(s.gain, places[few - 1].gain)};
  }
  return places;
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
  const auto loss = [&q](const StochasticModel& around) { return total(block_losses(around, q, {})); };
  for (int reference = 0;; ++reference) {
    Smoothing course;
    for (int i = 0; i < kExpectations; ++i) {
      course = smooth(model, q, {}, jobs);
      q = course.q.cwiseMax(kLeastVariance);
    }
    if (reference == kReferences) break;
    // What a linear model says of a course far away may be nonsense there: a flow sensor that is stuck asks for an
    // opening that no valve has.
    StochasticModel moved = model;
    move_reference(residuals, change, course.states, course.known, jobs, moved);
    if (!(loss(moved) < loss(model))) break;
    model = std::move(moved);
  }
  return {std::move(model), std::move(q)};
}

Discrepancy find_discrepancy(const ResidualModel& residuals, const ModelChange& change,
                             const std::vector<std::size_t>& runs, int jobs, Places places,
                             const std::vector<FreePlace>& noise) {
  FittedProcess process = fit_process(residuals, change, runs, jobs);
  StochasticModel& model = process.model;
  Eigen::VectorXd& q = process.q;
  const Eigen::Index states = q.size();
  if (places == Places::free) open_ports(residuals, change, jobs, model);
  std::vector<std::vector<Eigen::MatrixXd>> drives(noise.size());
  for (std::size_t i = 0; i < noise.size(); ++i) {
    if (output_of(residuals, noise[i].port)) continue;
    if (places == Places::none) open_ports(residuals, change, jobs, model, noise[i].port);
    drives[i] = drives_of(model, noise[i].port);
  }
  for (std::size_t i = 0; i < noise.size(); ++i) let_in(residuals, noise[i], drives[i], model, q);
  for (int i = 0; !noise.empty() && i < kExpectations; ++i)
    q.head(states) = smooth(model, q, {}, jobs).q.head(states).cwiseMax(kLeastVariance);
  Discrepancy result;
  result.losses = block_losses(model, q, {});
  result.loss = total(result.losses);
  for (const StochasticStretch& stretch : model.stretches)
    for (const Eigen::VectorXd& misfit : stretch.misfit)
      result.readings += static_cast<double>((misfit.array() == misfit.array()).count());
  for (Eigen::Index s = 0; s < states; ++s) result.noise.push_back(model.size[s] * std::sqrt(q[s]));
  if (places == Places::none) return result;
  result.places = free_places(model, q, result.loss, jobs);
  return result;
}

std::optional<std::size_t> output_of(const ResidualModel& residuals, const std::string& port) {
  if (port_kind(port) != PortKind::sensor) return {};
  const int channel = residuals.sheet().channel(residuals.sheet().port(port).channel);
  const auto at = std::find(residuals.outputs().begin(), residuals.outputs().end(), channel);
  if (at == residuals.outputs().end()) return {};
  return static_cast<std::size_t>(at - residuals.outputs().begin());
}

bool restarts_freely(const EffectSpec& effect) {
  const PortKind kind = port_kind(effect.port);
  if (kind == PortKind::line || kind == PortKind::transmission) return false;
  return kind != PortKind::sensor || !find_effect_type(effect.effect)->make()->remembers();
}

}  // namespace faultline
