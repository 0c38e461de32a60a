// Runs of the pump-controlled cylinder that several tests share.
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "config_folder.h"
#include "faultline/rig/simulator.h"

namespace faultline {

inline const Datasheet& cylinder() {
  static const Datasheet sheet = find_datasheet(config_folder(), "pump_cylinder");
  return sheet;
}

inline std::size_t cylinder_column(const std::string& channel) {
  return static_cast<std::size_t>(cylinder().channel(channel));
}

inline SimulationSetup cylinder_setup(const std::string& profile, const std::vector<std::string>& effects = {},
                                      std::uint64_t seed = 1) {
  SimulationSetup setup;
  setup.profile = profile;
  setup.seed = seed;
  for (const std::string& effect : effects) setup.effects.push_back(parse_effect(effect));
  return setup;
}

// A rig as recordings show it: parameters off by their tolerances, and the small effects that every recording carries.
inline SimulationSetup cylinder_off_nominal(const std::string& profile, std::uint64_t seed) {
  SimulationSetup setup = cylinder_setup(profile, cylinder().nuisance, seed);
  setup.parameters = draw_parameters(cylinder(), seed);
  return setup;
}

inline Recording cylinder_clean(const std::string& profile, double duration,
                                const std::vector<std::string>& effects = {}, double substep = 0) {
  SimulationSetup setup = cylinder_setup(profile, effects);
  setup.noise = false;
  setup.substep = substep;
  return simulate(cylinder(), setup, duration);
}

inline double cylinder_mean(const Recording& r, const std::string& channel, double from, double to) {
  double sum = 0;
  int count = 0;
  for (std::size_t k = 0; k < r.rows(); ++k)
    if (r.time[k] >= from && r.time[k] < to) sum += r.at(k, cylinder_column(channel)), ++count;
  return sum / count;
}

inline double cylinder_rms(const Recording& a, const Recording& b, const std::string& channel) {
  double squares = 0;
  for (std::size_t k = 0; k < a.rows(); ++k)
    squares += std::pow(a.at(k, cylinder_column(channel)) - b.at(k, cylinder_column(channel)), 2);
  return std::sqrt(squares / static_cast<double>(a.rows()));
}

}  // namespace faultline
