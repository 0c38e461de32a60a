// How far recording and model are apart, per channel and level, and where in the operating range the residual lives.
#pragma once

#include "faultline/gap/fit_gap.h"
#include "faultline/gap/gap_result.h"

namespace faultline {

// Fills result.gap (nominal, refit, explained; horizons 1, 10, 100, segment and free), regions and bands of the
// refitted model's residual, the run that shows the gap most, and that run's course. Uses `jobs` threads.
void measure_levels(const ResidualModel& model, const ModelChange& nominal, const ModelChange& refitted,
                    const FitResult& explained, int jobs, GapResult& result);

// The verdict in one sentence; `left`: in words, what no cause explains although it is far above the noise.
void describe(const Datasheet& sheet, GapResult& result, const std::string& left);

}  // namespace faultline
