// Since when a transducer may be stuck, as its readings tell: from then on it shows one value to the end of every run.
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

// The candidates, those of a stuck transducer narrowed to the neighbourhood of that time and left out where it is the
// end of the runs. What a command holds is not measured: it keeps its range.
std::vector<Candidate> where_still(const std::vector<Candidate>& candidates, const ResidualModel& residuals);

}  // namespace faultline
