// How much of a gap effects close, and how large a gap is.
//
//   shrink = 1 - excess(after)/excess(before)   of the losses of segments, with a 90 % interval by bootstrap over them
//   size   = root of the mean over the channels of (nrmse^2 (1 - (noise/rms)^2))
#pragma once

#include <cstdint>
#include <vector>

#include "faultline/gap/fit_gap.h"
#include "faultline/gap/gap_options.h"
#include "faultline/gap/gap_result.h"

namespace faultline {

// Of segments' losses, each of so many values: mean_excess() or typical_excess() of measure.h.
using Excess = double (*)(const std::vector<double>& segments, double values);

double shrink_of(Excess excess, const std::vector<double>& before, const std::vector<double>& after, double values);
Interval shrink_interval(Excess excess, const std::vector<double>& before, const std::vector<double>& after,
                         double values, std::uint64_t seed, std::size_t bootstraps);

// Gap beyond the noise over what the channels move. One that stands still is held against the one of its unit that
// moves most: whatever disturbs it is all that it moves.
double gap_size(const GapLevel& level);

// The most that is closed of what a level leaves in one output, of those where that is much. 0 where that is taken from
// others, as of what makes up for something else; by effects at sensors it must be nearly all, for they close their own
// channel whatever is wrong.
double output_shrink(const GapLevel& before, const GapLevel& after, const std::vector<Candidate>& effects,
                     const GapOptions::Verdict& options);

}  // namespace faultline
