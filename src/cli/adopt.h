// Writes what a gap diagnosis found into a copy of the datasheet: refitted parameters as new nominal values, named
// effects and the curve of a signal that is missing under `nominal_effects`. Comments and layout of the file stay.
#pragma once

#include <map>
#include <string>

#include "faultline/gap/gap_result.h"
#include "faultline/rig/datasheet.h"

namespace faultline {

// InputError where the answer is "unknown" without an effect or a curve, or the datasheet's text is of a form that
// cannot be edited in place.
void adopt(const Datasheet& sheet, const GapResult& result, const std::string& file);

// Parameters that are not nominal beside the curve of a missing signal: factors.
std::map<std::string, double> factors_beside(const Datasheet& sheet, const MissingSignal& missing);

}  // namespace faultline
