// The largest excess of the live gap (live_gap.h) that tolerances and nuisance effects make on a rig in good order, for
// a datasheet that does not say (`normal_gap`).
//
//   normal = 2 max over draws and profiles of the smoothed excess, at least 1 (noise variances)
//
// over 8 rigs drawn within their tolerances, each through up to 3 of the datasheet's profiles, for as long as the means
// go over. Twice, since 24 runs do not show the largest. Deterministic. Takes the model's time for those runs.
#pragma once

#include <map>
#include <string>

#include "faultline/gap/live_gap.h"

namespace faultline {

// Per output of the rig that is measured. InputError where the rig cannot be simulated.
std::map<std::string, double> simulated_normal_gap(const Datasheet& sheet, const LiveGapSettings& settings, int jobs);

}  // namespace faultline
