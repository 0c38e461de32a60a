// Writes what a gap diagnosis found into a copy of the datasheet: refitted parameters as new nominal values, named
// effects under `nominal_effects`. Comments and layout of the file stay.
#pragma once

#include <string>

#include "faultline/gap/gap_result.h"
#include "faultline/rig/datasheet.h"

namespace faultline {

// InputError where the answer is "unknown" or the datasheet's text is of a form that cannot be
// edited in place.
void adopt(const Datasheet& sheet, const GapResult& result, const std::string& file);

}  // namespace faultline
