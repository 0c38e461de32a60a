// Every candidate beside a fitted model, to first order (attribution/screening.h): simulated at few starting points,
// the parameters adjusted within their bounds, and with them the size on the line between no effect and that point.
#pragma once

#include <functional>

#include "faultline/gap/gap_trials.h"

namespace faultline {

// Each of `candidates` that the base does not have, best first, at its best point, with the effects of the base and the
// adjusted parameters; gains as far as the first order tells. An effect at a place comes once,
// whatever its points. `linear` must stand at the base. Simulates with `jobs` threads; `progress`, if given, takes
// the fraction that is done, from any of them.
std::vector<Structure> screen_candidates(const ResidualModel& residuals, const Linearisation& linear,
                                         const std::vector<Candidate>& candidates, const FitResult& base, int jobs,
                                         const std::function<void(double)>& progress);

}  // namespace faultline
