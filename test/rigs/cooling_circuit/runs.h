// Runs of the cooling circuit that several tests share.
#pragma once

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "faultline/rig/simulator.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {

inline const Datasheet& cooling() {
  static const Datasheet sheet = find_datasheet(config_folder(), "cooling_circuit");
  return sheet;
}

inline std::size_t cooling_column(const std::string& channel) {
  return static_cast<std::size_t>(cooling().channel(channel));
}

// A run without noise.
inline SimulationSetup cooling_setup(const std::string& profile, const std::vector<std::string>& effects = {}) {
  SimulationSetup setup;
  setup.profile = profile;
  setup.noise = false;
  for (const std::string& text : effects) setup.effects.push_back(parse_effect(text));
  return setup;
}

// The rig itself with effects, at rest under given commands and supply.
struct CoolingRig {
  CoolingRig(double supply, double valve, double heat, const std::vector<std::string>& texts = {})
      : channels(cooling().channels.size(), 0.0) {
    std::vector<EffectSpec> specs;
    for (const std::string& text : texts) specs.push_back(parse_effect(text));
    effects = std::make_unique<EffectSet>(cooling(), specs, 1e-3, 1);
    rig = find_rig_type("cooling_circuit")->make(cooling(), cooling().nominal(), *effects);
    channels[cooling_column("supply_pressure")] = supply;
    channels[cooling_column("bench_valve_command")] = valve;
    channels[cooling_column("heat_load_command")] = heat;
    state.resize(static_cast<std::size_t>(rig->states()));
    rig->start(channels.data(), state.data());
    show();
  }
  void show() { rig->outputs(0, state.data(), channels.data()); }
  double operator[](const std::string& channel) const { return channels[cooling_column(channel)]; }

  std::unique_ptr<EffectSet> effects;
  std::unique_ptr<Rig> rig;
  std::vector<double> channels, state;
};

// Middle of a parameter's range, evenly or, where it spans decades, by its logarithm; a time at 0.1 s.
inline double middle_of(const Bounds& bounds) {
  if (std::isinf(bounds.maximum)) return 0.1;
  if (bounds.minimum > 0 && bounds.maximum > 20 * bounds.minimum) return std::sqrt(bounds.minimum * bounds.maximum);
  const double middle = 0.5 * (bounds.minimum + bounds.maximum);
  return middle == 0 || middle == 1 ? 0.75 * bounds.maximum + 0.25 * bounds.minimum : middle;
}

// Every effect at every port of the datasheet, at the middle of its range.
inline std::vector<std::string> cooling_effects() {
  std::vector<std::string> texts;
  for (const Port& port : cooling().ports)
    for (const FittingEffect& fitting : port.effects) {
      std::string text = fitting.effect + "@" + port.name;
      char separator = ':';
      for (const auto& [name, bounds] : fitting.bounds) {
        text += fmt::format("{}{}={:.9g}", separator, name, middle_of(bounds));
        separator = ',';
      }
      texts.push_back(text);
    }
  return texts;
}

}  // namespace faultline
