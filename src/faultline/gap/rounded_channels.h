// Rounding that the datasheet does not know. The noise of a recording takes rounding in, so no residual shows it; but
// a signal that takes only values on a grid (segments/grid_step.h) shows it by itself.
#pragma once

#include "faultline/gap/gap_result.h"
#include "faultline/gap/residual_model.h"

namespace faultline {

// Channels whose grid in all runs is coarser than the datasheet's resolution and noise, as the effect `quantisation`
// where the datasheet lets it fit, has not adopted it and `without` does not leave it out. Only where rounding is a
// notable part of the noise, the recording's and the datasheet's: q^2/12 of its variance.
std::vector<NamedEffect> rounded_channels(const ResidualModel& model, const std::vector<std::string>& without);

}  // namespace faultline
