// What a simulation runs with.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "faultline/rig/datasheet.h"
#include "faultline/rig/effect.h"

namespace faultline {

struct SimulationSetup {
  std::string profile;                 // of the datasheet; empty: its first
  std::vector<double> parameters;      // in the datasheet's order; empty: nominal
  std::vector<EffectSpec> effects;     // on top of the datasheet's nominal effects
  std::vector<CommandTable> commands;  // for commands that no controller moves
  std::uint64_t seed = 1;              // of what differs from run to run; see below
  double substep = 0;                  // s; 0: the rig's own
  double sample_period = 0;            // s, of a driven model's recording; 0: the datasheet's
  bool noise = true;                   // sensor noise and rounding
  bool long_steps = false;             // of a driven model, where its motion is even (RigType::even_substep)
  bool beside = false;  // of a driven model: whether its long steps may go beside another's (integrator.h)
  bool rough = false;   // ... and whether steps of what is fast may be longer (RigType::rough_fast_substep)
};

// The datasheet's effects of the nominal model.
std::vector<EffectSpec> nominal_effects(const Datasheet& sheet);
// Integration steps per sample period of the model that a recording drives, with `effects` on top.
int model_substeps(const Datasheet& sheet, const std::vector<EffectSpec>& effects);

}  // namespace faultline
