// Units of effects speak of the port ("port", "port/s") where they depend on it; on a channel's port that is the
// channel's unit. "N s/m or N m s/rad": the second on a rig that turns and has nothing that slides.
#pragma once

#include <string>

#include "faultline/rig/datasheet.h"

namespace faultline {

std::string effect_unit(const Datasheet& sheet, const Port& port, const std::string& unit);

}  // namespace faultline
