// Runs of the servo actuator that several tests share.
#pragma once

#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "config_folder.h"
#include "faultline/rig/simulator.h"

namespace faultline {

inline const Datasheet& servo() {
  static const Datasheet sheet = find_datasheet(config_folder(), "servo_actuator");
  return sheet;
}

// The rig with its leak filter and detectors alone, as their own tests want it.
inline const Datasheet& servo_filter() {
  static const Datasheet sheet = [] {
    Datasheet copy = servo();
    copy.estimators.resize(1);
    copy.isolators.clear();
    return copy;
  }();
  return sheet;
}

inline std::size_t column(const std::string& channel) { return static_cast<std::size_t>(servo().channel(channel)); }

inline SimulationSetup servo_setup(const std::string& profile, std::uint64_t seed = 1) {
  SimulationSetup setup;
  setup.profile = profile;
  setup.seed = seed;
  return setup;
}

// The bypass valve goes from 0 to `volts` at `time` [s].
inline void open_bypass(SimulationSetup& setup, double time, double volts) {
  setup.commands.push_back({"leak_valve_command", {time, time + 0.001}, {0, volts}});
}

// A rig as recordings show it: parameters off by their tolerances, and the small effects that every recording carries.
inline SimulationSetup off_nominal(const std::string& profile, std::uint64_t seed) {
  SimulationSetup setup = servo_setup(profile, seed);
  setup.parameters = draw_parameters(servo(), seed);
  for (const std::string& effect : servo().nuisance) setup.effects.push_back(parse_effect(effect));
  return setup;
}

inline double mean_of(const Recording& r, const std::string& channel, double from, double to) {
  double sum = 0;
  int count = 0;
  for (std::size_t k = 0; k < r.rows(); ++k)
    if (r.time[k] >= from && r.time[k] < to) sum += r.at(k, column(channel)), ++count;
  return sum / count;
}

}  // namespace faultline
