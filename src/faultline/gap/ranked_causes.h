// What a search found, as the answer tells it: causes and places in their order, effects with intervals, and the set of
// those that cannot be told apart.
#pragma once

#include <string>
#include <vector>

#include "faultline/gap/effect_search.h"
#include "faultline/gap/gap_result.h"

namespace faultline {

// sensor: what is said; process: what is done.
std::string kind_of(const Datasheet& sheet, const std::string& port);

// The finalists of the first round with their distances and probabilities. Those that were not followed to the end
// are as far behind as their quick fits.
std::vector<RankedCause> rank_causes(const GapTrials& work, const EffectSearch& search);

// Places by the best candidate of each port. `inseparable`: probability from which another place may be it as well.
std::vector<PlaceScore> rank_places(const Datasheet& sheet, const std::vector<Structure>& screened,
                                    const std::vector<RankedCause>& causes, double inseparable);

// Places by what a free signal there wins, of which a fraction (rival_gain_fraction) is no difference, for what a model
// does wrong is the same from sample to sample.
std::vector<PlaceScore> free_places(const Datasheet& sheet, const Discrepancy& discrepancy,
                                    const GapOptions::Verdict& options);

// The effects that were found, and those that cannot be told from one of them: from the first among result.ranked.
// `ninety`: half width of 90 % bounds in standard errors.
void name_effects(const EffectSearch& search, double ninety, const GapOptions::Verdict& options, GapResult& result);

}  // namespace faultline
