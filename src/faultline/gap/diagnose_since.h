// Step 8 of diagnose_gap.h: a cause that began during the runs, or that some of them have.
#pragma once

#include <optional>
#include <string>

#include "faultline/gap/gap_settings.h"

namespace faultline {

// Nothing where no cause that began is told; `remark` says when something began all the same. `refit_excess`: what
// parameters of all runs leave. Where that is little of what those of before leave later, they explain both.
std::optional<GapResult> diagnose_since(const Datasheet& sheet, const std::vector<SegmentedRun>& runs,
                                        const std::vector<SegmentedRun>& holdout, const GapSettings& settings,
                                        const GapProgress& progress, double refit_excess, std::string& remark);

}  // namespace faultline
