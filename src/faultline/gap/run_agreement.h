// Whether all runs are of one rig: each run's parameters, fitted on that run alone from where the model stands, with
// the tolerances as prior. Where that wins much of what the common ones leave, no effect is to be sought before the
// runs are looked at: another rig, another oil, a rig that changed between them.
#pragma once

#include <string>

#include "faultline/gap/fit_gap.h"

namespace faultline {

// One sentence that names the parameter whose values lie farthest apart, in standard errors, and the two runs; empty
// where the runs agree. `linear`: of the runs to compare, at the model of `at`, whose effects stay as they are.
std::string disagreement(const ResidualModel& residuals, const Linearisation& linear, const FitResult& at, int jobs);

}  // namespace faultline
