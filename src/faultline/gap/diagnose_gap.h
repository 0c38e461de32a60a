// The gap diagnosis: measures the gap, refits the parameters, tries every effect at every fitting port, scores what
// it fitted on runs that it did not see, and says the verdict. Knows no rig.
//
// 1. nominal -> refit: parameters move within their tolerances (priors).
// 2. Screen: each candidate at a few sizes, one simulation each, parameters adjusted to first order.
// 3. The best are fitted together with the parameters on one part of the runs and scored on the other, both ways round.
// 4. The winner joins the model; a second and third effect must pay in the same way.
// 5. Rivals within two standard errors of the winner form the set that cannot be told apart.
// 6. Where a model takes several parameters to their bounds, without a cause or beside some, all this is asked again
//    with bounds that lie nearer, twice if need be: a name that is found then, one more or another that leaves no
//    more, lets them go back; so does one that leaves much less. Where one of several causes has next to no size
//    beside the others, without it: a later one has taken its place.
// 7. Where no cause is told, but readings of a state leave the integral of those of its rate (slow_drift.h), a drift of
//    that transducer is fitted over longer segments, and told where it is a cause there, of the same size.
// 8. Where the model explains the runs up to some moment only (onset.h), all this is asked again of what follows, of
//    the rig as it was before; a name that what was before contradicts is told with its date. So it is where the model
//    explains some runs and not the others, of a rig whose parameters may be others there.
// 9. Where a cause is unknown all this is asked again of shorter segments, and a name that is found there is told, if
//    it begins with what was told as a part of the cause: when a rig breaks away or strikes is a matter of little, and
//    a model that ran for longer is beside the recording whatever it knows of the cause.
// Deterministic: no random numbers but the bootstrap's, which are seeded.
#pragma once

#include "faultline/gap/gap_settings.h"

namespace faultline {

// `runs` to learn from; `holdout` to score on (empty: the runs score each other; one run is cut in two). Throws
// InputError.
GapResult diagnose_gap(const Datasheet& sheet, std::vector<SegmentedRun> runs, std::vector<SegmentedRun> holdout,
                       const GapSettings& settings, const GapProgress& progress);

}  // namespace faultline
