// A recording of fewer rows, each the mean of those around it, for a rig that shows nothing between them.
//
//   y_j = mean of y_k, |k - j n| <= (n - 1) / 2     outputs and inputs, at the time of row j n
//   u_j = mean of u_k, j n <= k < (j + 1) n         commands, which are held until the next row
//
// n is odd: the means have no phase, and white noise stays white. At the ends of a stretch without a break a mean takes
// as many rows on each side as there are. A signal that lies on a grid (grid_step.h) keeps the reading of row j n, as
// does a mean over a reading that is missing or at an end of its range.
#pragma once

#include <cstddef>

#include "faultline/rig/datasheet.h"
#include "faultline/segments/segment_options.h"
#include "faultline/signal/sample.h"

namespace faultline {

// `period`: s, between rows (even_rows.h). Channels of the recording in the datasheet's order.
Recording averaged_rows(const Datasheet& sheet, Recording recording, double period, std::size_t n,
                        const SegmentOptions& options = {});

}  // namespace faultline
