#include "faultline/rig/step_model.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "faultline/numerics/integrator.h"
#include "faultline/rig/even_step.h"
#include "faultline/rig/simulation_setup.h"
#include "faultline/signal/error.h"

namespace faultline {

namespace {

// The rig in one of its states.
struct Running {
  Running(const RigType& type, const Datasheet& sheet, const std::vector<double>& parameters, const EffectSet& effects)
      : rig(type.make(sheet, parameters, effects)), integrator(make_integrator(*rig)) {
    before.resize(static_cast<std::size_t>(rig->states()));
  }

  double* state() { return integrator->state(); }
  // At a state of the datasheet.
  double* set(const double* nominal, const double* channels) {
    rig->start_at(nominal, channels, state());
    rig->set_modes(state());
    rig->after_step(0, state(), channels);
    return state();
  }
  template <class Step>
  bool try_step(int motion, Step&& step) {
    return without_event(*rig, state(), before, motion, step);
  }

  std::unique_ptr<Rig> rig;
  std::unique_ptr<Integrator> integrator;
  std::vector<double> before;
};

}  // namespace

struct StepModel::Parts {
  Parts(const Datasheet& datasheet, const std::vector<double>& parameters, int beside)
      : sheet(datasheet), effects(sheet, nominal_effects(sheet), sheet.sample_period, 1) {
    const RigType* type = find_rig_type(sheet.rig);
    if (!type)
      throw InputError(
          fmt::format("{}: this build has the datasheet of '{}' but not its equations", sheet.file, sheet.rig));
    for (int i = 0; i <= beside; ++i)
      models.emplace_back(*type, sheet, parameters.empty() ? sheet.nominal() : parameters, effects);
    substep = sheet.sample_period / model_substeps(sheet, {});
    if (sheet.nominal_effects.empty()) even = std::max(1, static_cast<int>(type->even_substep / substep + 1e-9));
    held.resize(sheet.channels.size());
    commands.resize(sheet.channels.size());
    sensors.resize(sheet.channels.size());
    for (const Port& port : sheet.ports) {
      const EffectChain& chain = effects.at(port.name);
      if (chain.empty() || port.channel.empty()) continue;
      const auto channel = static_cast<std::size_t>(sheet.channel(port.channel));
      (port.kind == PortKind::command ? commands : sensors)[channel] = &chain;
    }
  }

  // What drives the equations in substeps `first` to `first` + `count` of `steps`.
  const double* drive(const double* from, const double* to, int first, int count, int steps) {
    const double share = (first + 0.5 * count) / steps;
    for (std::size_t c = 0; c < held.size(); ++c)
      if (sheet.channels[c].role == Role::input && sheet.channels[c].predicted_by.empty())
        held[c] = from[c] + share * (to[c] - from[c]);
    return held.data();
  }

  const Datasheet sheet;
  EffectSet effects;
  std::vector<Running> models;
  double substep;
  int even = 1;  // substeps that a longer step takes
  std::vector<double> held;
  std::vector<const EffectChain*> commands, sensors;  // per channel; null: none
};

StepModel::StepModel(const Datasheet& sheet, const std::vector<double>& parameters, int beside)
    : parts_(std::make_unique<Parts>(sheet, parameters, beside)) {}
StepModel::~StepModel() = default;

void StepModel::start(const double* plant, double* state) {
  Running& model = parts_->models.front();
  std::fill_n(model.state(), model.rig->states(), 0.0);
  model.rig->start(plant, model.state());
  std::copy_n(model.state(), parts_->sheet.states.size(), state);
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
  advance_all(state, 1, from, to, dt, next);
}

void StepModel::advance_all(const double* states, int count, const double* from, const double* to, double dt,
                            double* next) {
  Parts& p = *parts_;
  const std::size_t width = p.sheet.states.size(), models = static_cast<std::size_t>(count);
  std::copy_n(from, p.held.size(), p.held.begin());
  for (std::size_t m = 0; m < models; ++m) p.models[m].set(states + m * width, from);
  const int steps = std::max(1, static_cast<int>(std::ceil(dt / p.substep - 1e-6)));
  const double h = dt / steps;
  for (int i = 0, taken = 1; i < steps; i += taken) {
    const auto own = [&](Running& model, int first, int length) {
      model.integrator->step(first * h, length * h, p.drive(from, to, first, length, steps));
    };
    const auto alone = [&](Running& model, int length) {
      if (length > 1 && model.try_step(Rig::kUneven, [&] { own(model, i, length); })) return;
      for (int k = 0; k < length; ++k) own(model, i + k, 1);
    };
    Running& leader = p.models.front();
    const int motion = leader.rig->motion(leader.state());
    // `even` substeps at once, where no event falls into them (RigType::even_substep).
    const bool evenly = p.even > 1 && i + p.even <= steps && leader.try_step(motion, [&] { own(leader, i, p.even); });
    if (!evenly) own(leader, i, 1);
    taken = evenly ? p.even : 1;
    const bool leads = models > 1 && (evenly || leader.rig->stiff()) &&
                       leader.integrator->lead(i * h, taken * h, p.drive(from, to, i, taken, steps));
    for (std::size_t m = 1; m < models; ++m) {
      Running& other = p.models[m];
      const auto beside = [&] {
        other.integrator->step_beside(i * h, taken * h, p.drive(from, to, i, taken, steps), *leader.integrator,
                                      Look::once);
      };
      if (leads && leader.rig->stiff()) {
        beside();
      } else if (!(leads && other.try_step(motion, beside))) {
        alone(other, taken);
      }
    }
  }
  for (std::size_t m = 0; m < models; ++m) std::copy_n(p.models[m].state(), width, next + m * width);
}

void StepModel::outputs(const double* state, const double* plant, double* channels) {
  std::copy_n(plant, parts_->held.size(), channels);
  Running& model = parts_->models.front();
  model.rig->outputs(0, model.set(state, plant), channels);
}

double StepModel::undo_sensor(std::size_t channel, double shown, double time) const {
  return parts_->sensors[channel] ? parts_->sensors[channel]->undo_signal(shown, time) : shown;
}

}  // namespace faultline
