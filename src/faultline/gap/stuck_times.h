// Since when a transducer may be stuck, as its readings tell: from then on it shows one value to the end of every run;
// and since when a command may be, as the nominal model tells: from then on it follows no run.
// The loss over that time has a valley as narrow as the motion is fast - a moment too early, and what it holds is a
// mixture of what it showed - which no coarse search meets.
#pragma once

#include <vector>

#include "faultline/attribution/candidates.h"
#include "faultline/gap/residual_model.h"

namespace faultline {

// s from the beginning of a run; the latest over runs. A run that does not end still counts with its whole length.
// `noise`: of a reading that is not stuck, in the channel's unit: a transducer that is stuck may have it or not.
double still_since(const std::vector<SegmentedRun>& runs, std::size_t channel, double resolution, double noise);

// s from the beginning of a run, of the first segment that the nominal model leaves with all later ones; negative: of
// none. The segments' logarithms of the mean square step up there most, over their scatter (onset.h).
double not_followed_since(const ResidualModel& residuals);

// The candidates, those of a stuck transducer narrowed to the neighbourhood of that time and left out where it is the
// end of the runs. What a command holds is not measured: it keeps its range, and comes once more with the neighbourhood
// of the time since which nothing follows.
std::vector<Candidate> where_still(const std::vector<Candidate>& candidates, const ResidualModel& residuals);

}  // namespace faultline
