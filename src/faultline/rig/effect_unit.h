// Units of effects speak of the port ("port", "port/s") where they depend on it: that is the port's `unit` in the
// datasheet, else the channel's, or that of a force. "N s/m or N m s/rad": the second on a rig that turns and has
// nothing that slides. What the port's `units` say of a parameter of an effect goes before that.
#pragma once

#include <string>

#include "faultline/rig/datasheet.h"
#include "faultline/rig/effect.h"

namespace faultline {

std::string effect_unit(const Datasheet& sheet, const Port& port, const std::string& unit);

std::string parameter_unit(const Datasheet& sheet, const Port& port, const EffectType& effect,
                           const EffectParameter& parameter);

}  // namespace faultline
