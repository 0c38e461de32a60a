#include "faultline/rig/step_model.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "faultline/numerics/integrator.h"
#include "faultline/rig/rig.h"
#include "faultline/rig/simulation_setup.h"
#include "faultline/signal/error.h"

namespace faultline {

struct StepModel::Parts {
  Parts(const Datasheet& datasheet, const std::vector<double>& parameters)
      : sheet(datasheet), effects(sheet, nominal_effects(sheet), sheet.sample_period, 1) {
    const RigType* type = find_rig_type(sheet.rig);
    if (!type)
      throw InputError(
          fmt::format("{}: this build has the datasheet of '{}' but not its equations", sheet.file, sheet.rig));
    rig = type->make(sheet, parameters.empty() ? sheet.nominal() : parameters, effects);
    integrator = make_integrator(*rig);
    substep = sheet.sample_period / model_substeps(sheet, {});
    if (sheet.nominal_effects.empty()) even = std::max(1, static_cast<int>(type->even_substep / substep + 1e-9));
    before.resize(static_cast<std::size_t>(rig->states()));
    held.resize(sheet.channels.size());
    state.resize(static_cast<std::size_t>(rig->states()));
    commands.resize(sheet.channels.size());
    sensors.resize(sheet.channels.size());
    for (const Port& port : sheet.ports) {
      const EffectChain& chain = effects.at(port.name);
      if (chain.empty() || port.channel.empty()) continue;
      const auto channel = static_cast<std::size_t>(sheet.channel(port.channel));
      (port.kind == PortKind::command ? commands : sensors)[channel] = &chain;
    }
  }

  // The rig at a state of the datasheet.
  double* at(const double* nominal, const double* channels) {
    rig->start_at(nominal, channels, state.data());
    rig->set_modes(state.data());
    rig->after_step(0, state.data(), channels);
    return state.data();
  }

  // Substeps `first` to `first` + `count` of `steps` over `dt`.
  void step(const double* from, const double* to, double dt, int first, int count, int steps) {
    const double share = (first + 0.5 * count) / steps;
    for (std::size_t c = 0; c < held.size(); ++c)
      if (sheet.channels[c].role == Role::input && sheet.channels[c].predicted_by.empty())
        held[c] = from[c] + share * (to[c] - from[c]);
    integrator->step(first * dt / steps, count * dt / steps, held.data());
  }

  // `even` substeps at once, where no event falls into them (RigType::even_substep).
  bool step_evenly(const double* from, const double* to, double dt, int first, int steps) {
    const int motion = rig->motion(integrator->state());
    if (motion == Rig::kUneven) return false;
    std::copy_n(integrator->state(), before.size(), before.begin());
    step(from, to, dt, first, even, steps);
    if (rig->motion(integrator->state()) == motion) return true;
    std::copy_n(before.begin(), before.size(), integrator->state());
    rig->set_modes(integrator->state());
    return false;
  }

  const Datasheet sheet;
  EffectSet effects;
  std::unique_ptr<Rig> rig;
  std::unique_ptr<Integrator> integrator;
  double substep;
  int even = 1;  // substeps that a longer step takes
  std::vector<double> held, state, before;
  std::vector<const EffectChain*> commands, sensors;  // per channel; null: none
};

StepModel::StepModel(const Datasheet& sheet, const std::vector<double>& parameters)
    : parts_(std::make_unique<Parts>(sheet, parameters)) {}
StepModel::~StepModel() = default;

void StepModel::start(const double* plant, double* state) {
  std::fill(parts_->state.begin(), parts_->state.end(), 0.0);
  parts_->rig->start(plant, parts_->state.data());
  std::copy_n(parts_->state.begin(), parts_->sheet.states.size(), state);
}

void StepModel::prepare(double time, const double* channels, double* plant) {
  for (std::size_t c = 0; c < parts_->held.size(); ++c) {
    plant[c] = channels[c];
    if (parts_->commands[c]) plant[c] = parts_->commands[c]->signal(channels[c], time);
    if (!parts_->sensors[c] || parts_->sheet.channels[c].role != Role::input) continue;
    const double value = parts_->sensors[c]->undo_signal(channels[c], time);
    if (!std::isnan(value)) plant[c] = value;
  }
}

void StepModel::advance(const double* state, const double* from, const double* to, double dt, double* next) {
  Parts& p = *parts_;
  std::copy_n(from, p.held.size(), p.held.begin());
  std::copy_n(p.at(state, from), p.state.size(), p.integrator->state());
  const int steps = std::max(1, static_cast<int>(std::ceil(dt / p.substep - 1e-6)));
  for (int i = 0; i < steps;) {
    const bool evenly = p.even > 1 && i + p.even <= steps && p.step_evenly(from, to, dt, i, steps);
    if (!evenly) p.step(from, to, dt, i, 1, steps);
    i += evenly ? p.even : 1;
  }
  std::copy_n(p.integrator->state(), p.sheet.states.size(), next);
}

void StepModel::outputs(const double* state, const double* plant, double* channels) {
  std::copy_n(plant, parts_->held.size(), channels);
  parts_->rig->outputs(0, parts_->at(state, plant), channels);
}

double StepModel::undo_sensor(std::size_t channel, double shown, double time) const {
  return parts_->sensors[channel] ? parts_->sensors[channel]->undo_signal(shown, time) : shown;
}

}  // namespace faultline
