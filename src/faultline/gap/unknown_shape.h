// What "unknown" shows: the signal that is missing at the likeliest place (missing_signal.h), and a curve of it that
// can be adopted, fitted together with the parameters in the rig's own model. Parameters that were refitted while the
// signal was missing stand for a part of it; so the signal is reconstructed a second time, beside those that stand with
// the curve.
#pragma once

#include "faultline/gap/effect_search.h"
#include "faultline/gap/missing_signal.h"

namespace faultline {

// Beside the effects that were found where `names`, else beside the refit. `excess`: what that leaves on held-out data,
// in noise variances. Leaves `work` standing elsewhere. What cannot be adopted is a remark.
MissingSignal unknown_shape(GapTrials& work, const EffectSearch& search, bool names, double excess,
                            std::vector<std::string>& remarks);

}  // namespace faultline
