// Runs of the cooling circuit as recordings show it: parameters off the datasheet, the small nuisance effects, sensor
// noise.
#pragma once

#include <string>

#include "rigs/cooling_circuit/runs.h"

namespace faultline {

inline SimulationSetup cooling_recording(const std::string& profile, std::uint64_t seed,
                                         const std::string& effect = "") {
  SimulationSetup setup;
  setup.profile = profile;
  setup.seed = seed;
  setup.parameters = draw_parameters(cooling(), seed);
  for (const std::string& nuisance : cooling().nuisance) setup.effects.push_back(parse_effect(nuisance));
  if (!effect.empty()) setup.effects.push_back(parse_effect(effect));
  return setup;
}

}  // namespace faultline
