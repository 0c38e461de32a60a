// Settings of the estimator type `fault_response`, for the stage and for whoever asks what it would see (faultline
// isolability).
#pragma once

#include "faultline/estimators/fault_responses.h"

namespace faultline {

// Settings: segment, segments, every, recent, memory, inflation, threshold, confirmed, explained; those of
// ResponseSettings where there is none given.
ResponseSettings response_settings(const Datasheet& sheet, const StageSpec& spec);

// Of the datasheet's first stage of the family response; without one those of ResponseSettings.
ResponseSettings response_settings(const Datasheet& sheet);

}  // namespace faultline
