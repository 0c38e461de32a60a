// One search through runs as they are, from the gap to its verdict: steps 1 to 5 of diagnose_gap.h.
#pragma once

#include "faultline/gap/gap_settings.h"

namespace faultline {

// Of what is asked again in another way only a name counts: an "unknown" says nothing more then.
enum class Wanted { answer, name };

// `sheet`: the rig that is asked about. `stated`: what the user's datasheet says of its parameters, where the rig was
// calibrated since. Throws InputError.
GapResult diagnose_runs(const Datasheet& sheet, const Datasheet& stated, std::vector<SegmentedRun> runs,
                        std::vector<SegmentedRun> holdout, const GapSettings& settings, const GapProgress& progress,
                        Wanted wanted = Wanted::answer);

}  // namespace faultline
