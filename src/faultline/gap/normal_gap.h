// The largest excess of the live gap (live_gap.h) that tolerances and nuisance effects make on a rig in good order, for
// a datasheet that does not say (`normal_gap`).
//
//   normal = 2 max over draws and profiles of the smoothed excess, at least 1 (noise variances)
//
// over 8 rigs drawn within their tolerances, each through up to 3 of the datasheet's profiles, for six times as long as
// the means go over: profiles move through operating points. Twice, since 24 runs do not show the largest.
// Deterministic. Takes the model's time for those runs.
#pragma once

#include <functional>
#include <map>
#include <string>

#include "faultline/gap/live_gap.h"

namespace faultline {

// How many simulations these are.
std::size_t normal_gap_simulations(const Datasheet& sheet);

// Told many times a simulation how many are done, from several threads; false: it is to end soon, without a result.
using NormalGapProgress = std::function<bool(std::size_t done)>;

// Per output of the rig that is measured. InputError where the rig cannot be simulated.
std::map<std::string, double> simulated_normal_gap(
    const Datasheet& sheet, const LiveGapSettings& settings, int jobs,
    const NormalGapProgress& progress = [](std::size_t) { return true; });

}  // namespace faultline
