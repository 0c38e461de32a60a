// Runs of the control valve that several tests share.
#pragma once

#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "config_folder.h"
#include "faultline/numerics/integrator.h"
#include "faultline/rig/simulator.h"

namespace faultline {

inline const Datasheet& valve() {
  static const Datasheet sheet = find_datasheet(config_folder(), "control_valve");
  return sheet;
}

inline std::size_t valve_column(const std::string& channel) {
  return static_cast<std::size_t>(valve().channel(channel));
}

inline double noise_of(const std::string& channel) { return valve().channels[valve_column(channel)].noise_std; }

inline SimulationSetup valve_setup(const std::string& profile, const std::vector<std::string>& effects = {},
                                   bool noise = false) {
  SimulationSetup setup;
  setup.profile = profile;
  setup.noise = noise;
  for (const std::string& text : effects) setup.effects.push_back(parse_effect(text));
  return setup;
}

// A rig as recordings show it: parameters off by their tolerances, and the small effects that every recording carries.
inline SimulationSetup off_nominal_valve(const std::string& profile, std::uint64_t seed) {
  SimulationSetup setup = valve_setup(profile, valve().nuisance, true);
  setup.seed = seed;
  setup.parameters = draw_parameters(valve(), seed);
  return setup;
}

// The rig itself, with effects, under held inputs: 5 bar, 20 C, the spool in the middle, half open, at rest.
struct ValveRig {
  enum { kFlapper, kPrestage, kSpool, kCylinder, kPiston, kTorque, kPlay, kTwist };

  explicit ValveRig(const std::vector<std::string>& texts = {}, double supply = 5e5, double temperature = 293.15)
      : channels(valve().channels.size(), 0.0) {
    std::vector<EffectSpec> specs;
    for (const std::string& text : texts) specs.push_back(parse_effect(text));
    effects = std::make_unique<EffectSet>(valve(), specs, kStep, 1);
    rig = find_rig_type("control_valve")->make(valve(), valve().nominal(), *effects);
    at("supply_pressure") = supply;
    at("ambient_temperature") = temperature;
    at("coil_voltage") = 1.98;
    integrator = make_integrator(*rig);
    rig->start(channels.data(), integrator->state());
    rate.resize(static_cast<std::size_t>(rig->states()));
  }

  double& at(const std::string& channel) { return channels[valve_column(channel)]; }
  double* state() { return integrator->state(); }
  // Of every state, at the state as it stands.
  const std::vector<double>& rates() {
    rig->derivative(time, state(), channels.data(), rate.data());
    return rate;
  }
  void run(double duration) {
    run(duration, [] {});
  }
  // `each`: after every step.
  void run(double duration, const std::function<void()>& each) {
    for (auto left = std::llround(duration / kStep); left > 0; --left) {
      effects->set_time(time);
      integrator->step(time, kStep, channels.data());
      time += kStep;
      each();
    }
  }
  double shows(const std::string& channel) {
    rig->outputs(time, state(), channels.data());
    return at(channel);
  }

  static constexpr double kStep = 0.5e-3;
  std::unique_ptr<EffectSet> effects;
  std::unique_ptr<Rig> rig;
  std::unique_ptr<Integrator> integrator;
  std::vector<double> channels, rate;
  double time = 0;
};

}  // namespace faultline
