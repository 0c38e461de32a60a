#include "faultline/segments/propagation.h"

#include <algorithm>
#include <cmath>

namespace faultline {
namespace {

constexpr double kStepFraction = 1e-4;  // of a state's size: above rounding, below bends
constexpr double kLeastStep = 1e-9;     // where it has no size

SimulationSetup setup_of(const ModelChange& change, double period) {
  SimulationSetup setup;
  setup.parameters = change.parameters;
  setup.effects = change.effects;
  setup.sample_period = period;
  setup.noise = false;
  return setup;
}

}  // namespace

Eigen::VectorXd difference_steps(const Datasheet& sheet, const Eigen::VectorXd& size) {
  Eigen::VectorXd steps(size.size());
  for (Eigen::Index s = 0; s < size.size(); ++s) {
    const int channel = sheet.states[static_cast<std::size_t>(s)].channel;
    const double range = channel < 0 ? 0
                                     : sheet.channels[static_cast<std::size_t>(channel)].maximum -
                                           sheet.channels[static_cast<std::size_t>(channel)].minimum;
    steps[s] = std::max(kStepFraction * std::max(size[s], range), kLeastStep);
  }
  return steps;
}

Propagation::Propagation(const Datasheet& sheet, const ModelChange& change, double period)
    : model_(sheet, setup_of(change, period)), outputs_(compared_outputs(sheet)) {
  for (const State& state : sheet.states)
    shown_by_.push_back(std::find(outputs_.begin(), outputs_.end(), state.channel) == outputs_.end() ? -1
                                                                                                     : state.channel);
}

Step Propagation::step(const Recording& recording, std::size_t row, const Eigen::VectorXd& state) {
  Step result{state, Eigen::VectorXd(static_cast<Eigen::Index>(outputs_.size()))};
  model_.run(recording, row, 2, {row}, state.data(), [&](std::size_t k, const double* channels) {
    for (Eigen::Index o = 0; k == row && o < result.outputs.size(); ++o)
      result.outputs[o] = channels[outputs_[static_cast<std::size_t>(o)]];
    for (Eigen::Index s = 0; k > row && s < result.next.size(); ++s) {
      const int channel = shown_by_[static_cast<std::size_t>(s)];
      result.next[s] = channel < 0 ? model_.state()[s] : channels[channel];
    }
  });
  return result;
}

void Propagation::jacobians(const Recording& recording, std::size_t row, const Eigen::VectorXd& state,
                            const Eigen::VectorXd& size, Eigen::MatrixXd& f, Eigen::MatrixXd& h) {
  const Eigen::Index n = state.size();
  f.resize(n, n);
  h.resize(static_cast<Eigen::Index>(outputs_.size()), n);
  for (Eigen::Index s = 0; s < n; ++s) {
    Eigen::VectorXd moved = state;
    moved[s] = state[s] + size[s];
    const Step up = step(recording, row, moved);
    moved[s] = state[s] - size[s];
    const Step down = step(recording, row, moved);
    f.col(s) = (up.next - down.next) / (2 * size[s]);
    h.col(s) = (up.outputs - down.outputs) / (2 * size[s]);
  }
}

Eigen::VectorXd Propagation::own_start(const Recording& recording, std::size_t row) {
  Eigen::VectorXd state(static_cast<Eigen::Index>(shown_by_.size()));
  model_.run(recording, row, 1, {}, nullptr, [&](std::size_t, const double* channels) {
    for (Eigen::Index s = 0; s < state.size(); ++s) {
      const int channel = shown_by_[static_cast<std::size_t>(s)];
      state[s] = channel < 0 ? model_.state()[s] : channels[channel];
    }
  });
  return state;
}

}  // namespace faultline
