// Rigs whose states are not estimated over a run (state_smoother.h), because no channel shows any and they are many:
// the model begins at the rig's own start and runs on from segment to segment.
#pragma once

#include <string>

#include "faultline/rig/datasheet.h"

namespace faultline {

bool runs_on_from_its_own_start(const Datasheet& sheet);
// What must be said of such a rig if its states last longer than a segment; else nothing.
std::string remark_of_own_start(const Datasheet& sheet, double segment_s);

}  // namespace faultline
