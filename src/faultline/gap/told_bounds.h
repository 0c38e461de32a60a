// What of an answer lies at the ends of what it was allowed: parameters as far from the datasheet as they may go, and
// sizes of effects beyond the datasheet's ranges or at the end of what is tried.
#pragma once

#include <string>
#include <vector>

#include "faultline/gap/fit_gap.h"
#include "faultline/gap/gap_options.h"
#include "faultline/gap/gap_result.h"

namespace faultline {

// Parameters of a level that lie as far from the datasheet as they may.
std::vector<std::string> at_bounds(const Datasheet& sheet, const GapLevel& level, const GapOptions& options);
// What the datasheet's tolerances say against a level's parameters: minus log likelihood.
double prior_loss(const Datasheet& sheet, const GapLevel& level);
// Those of a model in one sentence; empty: none.
std::string told_at_bounds(const Datasheet& sheet, const ModelChange& model, const GapOptions& options);

// Whether a size of an effect lies beyond the datasheet's range; a time is no size.
bool beyond_range(const Datasheet& sheet, const Candidate& candidate);
// ... and whether it lies at the end of what is tried.
bool at_farthest(const Datasheet& sheet, const Candidate& candidate, const GapOptions& options);
// Those beyond in one sentence; empty: none.
std::string told_beyond_range(const Datasheet& sheet, const std::vector<Candidate>& effects);

}  // namespace faultline
