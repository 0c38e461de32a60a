// Units of effects speak of the port ("port", "port/s") where they depend on it; on a channel's port that is the channel's unit.
#pragma once

#include <string>

#include "faultline/rig/datasheet.h"

namespace faultline {

std::string effect_unit(const Datasheet& sheet, const Port& port, const std::string& unit);

}  // namespace faultline
