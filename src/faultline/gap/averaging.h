// Over how many rows of a recording the gap averages readings (averaged_rows.h): what a rig shows far more slowly than
// it is sampled says the same in fewer readings of less noise, and each row costs a step of everything.
#pragma once

#include <cstddef>
#include <vector>

#include "faultline/gap/gap_options.h"
#include "faultline/rig/datasheet.h"
#include "faultline/signal/sample.h"

namespace faultline {

// Odd, so many that a row then lasts RigType::shown_period at most, and fewer where readings swing too fast for that at
// a frequency that an effect of the rig has; 1: as they are. The least of all runs; channels in the datasheet's order.
std::size_t rows_to_average(const Datasheet& sheet, const std::vector<const Recording*>& recordings,
                            const GapOptions& options = {});

// What counts in variances of a reading, or for each of them, for readings of so many rows: what a model misses is as
// large as before, their noise is less.
GapOptions for_averages(GapOptions options, std::size_t rows);

}  // namespace faultline
