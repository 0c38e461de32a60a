// Which segments of long recordings causes are sought on. What a search must tell apart - which effect, about which
// size - shows in a part of the segments already; sizes, scores and bounds are taken from all.
#pragma once

#include "faultline/gap/linearisation.h"

namespace faultline {

// Segments of each run (rising), in pieces of neighbours, so that memories fill: half of them where the model at which
// `linear` stands misses most, half evenly spread. All of them where that spares little. `linear`: of all runs.
std::vector<std::vector<std::size_t>> telling_segments(const Linearisation& linear, const ResidualModel& residuals);

}  // namespace faultline
