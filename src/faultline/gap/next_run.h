// Which excitation would tell two explanations apart: each profile of the datasheet is simulated with one of them,
// and the other, with its parameters adjusted to first order, is held against that. The loss that remains is the
// predicted log-likelihood between them.
#pragma once

#include "faultline/gap/fit_gap.h"
#include "faultline/gap/gap_result.h"

namespace faultline {

// Best first; only profiles that separate the two by more than chance. `jobs` threads. A profile that cannot be
// simulated with the first explanation is left out, and `remarks` says so: the answer does not depend on it.
std::vector<NextRun> separating_runs(const Datasheet& sheet, const ModelChange& first, const ModelChange& second,
                                     const std::string& between, const GapOptions& options, int jobs,
                                     std::vector<std::string>& remarks);

}  // namespace faultline
