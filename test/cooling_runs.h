// Runs of the cooling circuit that several tests share: always with parameters off the datasheet and the small nuisance effects.
#pragma once

#include <string>
#include <vector>

#include "faultline/estimators/estimate.h"
#include "servo_runs.h"

namespace faultline {

inline const Datasheet& cooling() {
  static const Datasheet sheet = find_datasheet(config_folder(), "cooling_circuit");
  return sheet;
}

inline SimulationSetup cooling_setup(const std::string& profile, std::uint64_t seed, const std::string& effect = "") {
  SimulationSetup setup;
  setup.profile = profile;
  setup.seed = seed;
  setup.parameters = draw_parameters(cooling(), seed);
  for (const std::string& nuisance : cooling().nuisance) setup.effects.push_back(parse_effect(nuisance));
  if (!effect.empty()) setup.effects.push_back(parse_effect(effect));
  return setup;
}

// The values of one quantity of an estimate.
inline double quantity(const std::vector<Quantity>& quantities, const std::string& name) {
  for (const Quantity& q : quantities)
    if (q.name == name) return q.value;
  return std::nan("");
}

}  // namespace faultline
