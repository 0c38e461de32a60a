// Runs of the hydraulic drive that several tests share.
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "config_folder.h"
#include "faultline/rig/simulator.h"

namespace faultline {

inline const Datasheet& drive() {
  static const Datasheet sheet = find_datasheet(config_folder(), "hydraulic_drive");
  return sheet;
}

inline std::size_t drive_column(const std::string& channel) {
  return static_cast<std::size_t>(drive().channel(channel));
}

inline double drive_nominal(const std::string& parameter) {
  return drive().nominal()[static_cast<std::size_t>(drive().parameter(parameter))];
}

inline SimulationSetup drive_setup(const std::string& profile, std::uint64_t seed = 1) {
  SimulationSetup setup;
  setup.profile = profile;
  setup.seed = seed;
  return setup;
}

// The plant as it is: no noise, no rounding.
inline SimulationSetup drive_plain(const std::string& profile, const std::vector<std::string>& effects = {}) {
  SimulationSetup setup = drive_setup(profile);
  setup.noise = false;
  for (const std::string& effect : effects) setup.effects.push_back(parse_effect(effect));
  return setup;
}

// A rig as recordings show it: parameters off by their tolerances, and the small effects that every recording carries.
inline SimulationSetup drive_off_nominal(const std::string& profile, std::uint64_t seed) {
  SimulationSetup setup = drive_setup(profile, seed);
  setup.parameters = draw_parameters(drive(), seed);
  for (const std::string& effect : drive().nuisance) setup.effects.push_back(parse_effect(effect));
  return setup;
}

// Root mean square of a channel's difference between two recordings from a row on, in its noise.
inline double drive_apart(const Recording& a, const Recording& b, const std::string& channel, std::size_t first = 0) {
  const std::size_t c = drive_column(channel);
  double squares = 0;
  for (std::size_t k = first; k < a.rows(); ++k) squares += std::pow(a.at(k, c) - b.at(k, c), 2);
  return std::sqrt(squares / static_cast<double>(a.rows() - first)) / drive().channels[c].noise_std;
}

}  // namespace faultline
