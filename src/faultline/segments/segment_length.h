// How long the segments are in which a rig's model is held against recordings.
//
//   the datasheet's `segment`, where it has one; else
//   min(10 tau, duration/16), at least 20 samples     tau: the rig's slowest time scale (rig/time_scales.h)
//
// Ten times the slowest scale is long against what the start states leave, and slow effects show; sixteen segments are
// what statistics over segments need, and twenty samples hold more than the start states take.
#pragma once

#include <vector>

#include "faultline/rig/datasheet.h"
#include "faultline/signal/sample.h"

namespace faultline {

// s, for runs that are looked at together.
double segment_length(const Datasheet& sheet, const std::vector<const Recording*>& runs);
// s, where no run is known yet and they may be as long as they like.
double segment_length(const Datasheet& sheet);
// s, while the rig runs: shorter, 2 tau, since what is wrong must show soon.
double live_segment_length(const Datasheet& sheet);

}  // namespace faultline
