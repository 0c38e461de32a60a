// Rounding that the datasheet does not know. The noise of a recording takes rounding in, so no residual shows it; but
// a signal that takes only values on a grid shows it by itself.
//
//   y_k = y_0 + n_k q,  n_k whole, for all samples within the datasheet's resolution
//   q: the smallest distance between values
#pragma once

#include "faultline/gap/gap_result.h"
#include "faultline/gap/residual_model.h"

namespace faultline {

// q of a recorded channel in its unit; 0 where the values lie on no grid coarser than twice `resolution`.
double grid_step(const Recording& recording, std::size_t column, double resolution,
                 const GapOptions::Grid& options = {});

// Channels whose grid in all runs is coarser than the datasheet's resolution and noise, as the effect `quantisation`
// where the datasheet lets it fit, has not adopted it and `without` does not leave it out. Only where rounding is a
// notable part of the noise, the recording's and the datasheet's: q^2/12 of its variance.
std::vector<NamedEffect> rounded_channels(const ResidualModel& model, const std::vector<std::string>& without);

}  // namespace faultline
