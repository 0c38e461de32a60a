// How fast a rig's own model is, and how long the segments are in which it is held against recordings.
//
//   F(row) = d x_k+1 / d x_k (propagation.h),  lambda: its eigenvalues,  scale = T/|ln lambda|   T: sample period
//
// Scales are taken at rows spread over the run that the model makes when it is driven by the recording, and the median
// of the rows counts. An eigenvalue that takes longer than the recording to change anything is an integrator's and has
// no scale; what settles within a sample counts as that.
#pragma once

#include <vector>

#include "faultline/rig/datasheet.h"
#include "faultline/signal/sample.h"

namespace faultline {

// Per state, s, rising; infinite for integrators.
std::vector<double> time_scales(const Datasheet& sheet, const Recording& recording);

// Length of a segment, s. The datasheet's `segment`, where it has one. Else ten times the slowest scale that is no
// integrator's - long against what the start states leave, and slow effects show - but so short that the runs hold
// sixteen of them, and no shorter than twenty samples.
double segment_length(const Datasheet& sheet, const std::vector<const Recording*>& runs);
// The same where no run is known yet: as for a run of one hundred segments at mid command.
double segment_length(const Datasheet& sheet);

}  // namespace faultline
