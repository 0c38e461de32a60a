// What a datasheet may leave out where this build has the rig's equations, so that a rig of equations and a datasheet
// can be run, fitted and diagnosed: profiles, values of inputs, parameters to identify, estimators, detectors and
// isolators. Lengths and amplitudes come from a step test of the model (time_scales.h), noise from the channels; what
// is filled in stands in Datasheet::defaulted. Given but empty (`detectors: []`) means that none is wanted.
//
//   tau         the slowest time scale, or a third of the settling time where that is longer
//   profiles    without `profiles` and `controllers`, open loop within the levels that leave every output in its
//               range: `steps` (random levels, held for 0.3 to 3 tau), `prbs` (both ends of that range, clock 0.3 tau),
//               `multisine` (from 0.05/tau up to what the fastest time scale passes); each 60 tau or 12 judgements of
//               the responses long, of 500 to 100000 samples
//   inputs      those without a value: the middle of their range
//   identify    where no parameter is marked, those with a tolerance
//   estimators  `model_filter`, an unscented Kalman filter on the rig's own model (estimators/rig_model.cpp), or
//               `channels` (estimators/channels.cpp) for a rig of more states than a filter takes; and `responses`
//               (estimators/fault_responses.h), whose segments are four slowest scales long, at least 0.8 of the
//               settling time
//   detectors   without estimators too: `model_fit` of that filter, and `frozen_CHANNEL`, `noisy_CHANNEL` for every
//               measured channel whose noise is declared and seen; out of range and missing are told without a detector
//   isolators   `fault` and `second_fault` on an estimator of type fault_response
//
// A rig without equations is left as it is.
#pragma once

#include <set>
#include <string>

#include "faultline/rig/datasheet.h"

namespace faultline {

// `given`: keys at the top of its files.
void complete_datasheet(Datasheet& sheet, const std::set<std::string>& given);

// What was filled in, as a datasheet has it.
std::string defaulted_text(const Datasheet& sheet);
// Of that the stages alone, as stages.yaml has them.
std::string defaulted_stages(const Datasheet& sheet);

}  // namespace faultline
