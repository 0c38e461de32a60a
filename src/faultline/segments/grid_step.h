// The grid on which a recorded signal was rounded, where the datasheet knows of none or of a finer one.
//
//   y_k = y_0 + n_k q,  n_k whole, for all samples within the datasheet's resolution
//   q: the smallest distance between values
#pragma once

#include <cstddef>
#include <vector>

#include "faultline/segments/segment_options.h"

namespace faultline {

// q in the unit of the values; 0 where they lie on no grid coarser than twice `resolution`, are fewer than
// `least_levels` distinct ones, or are different more often than not. Values that are not finite are missing.
double grid_step(std::vector<double> values, double resolution, std::size_t least_levels,
                 const SegmentOptions& options = {});

// Standard deviation of what such a grid takes away of a signal that passes over it: q / sqrt(12).
double rounding_noise(double step);

}  // namespace faultline
