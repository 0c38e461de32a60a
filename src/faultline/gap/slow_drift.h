// A slow drift of a transducer at which states are put back: within a segment it moves less than the noise, and what
// adds up over a run shows only against a transducer of its rate.
//
//   y_k - y_0 - sum r_i T = (drift + scale v_s + lag dv_s) t_k + e_k     within segment s, t_k = k T
//
// y, r: readings of the state and of its rate; v_s, dv_s: mean and change of r over the segment, so that a scale or a
// lag of either transducer is no drift. The slopes of the left side, segment by segment, are fitted by least squares;
// their scatter gives the standard error. What acts in the equations moves both transducers alike, and a drift of the
// rate's own is one as well: only beside a model that does without it is it the state's.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "faultline/gap/gap_options.h"
#include "faultline/rig/datasheet.h"
#include "faultline/segments/segmented_run.h"

namespace faultline {

struct RateApart {
  double rate = 0, standard_error = 0;  // of the state's reading, in its unit/s
};

// The channel that shows the rate of what `channel` shows: of another state, in its unit/s. Nothing where there is
// none.
std::optional<int> rate_channel(const Datasheet& sheet, int channel);

// Nothing where fewer than eight segments have all readings, or where `rate` is no rate of `channel`.
std::optional<RateApart> rate_apart(const std::vector<SegmentedRun>& runs, int channel, int rate);

// Runs in longer segments, and a transducer at which a drift fits and whose readings leave the integral of their rate.
struct RunsAway {
  std::string port, channel;
  RateApart apart;
  std::vector<SegmentedRun> runs, holdout;
  std::size_t times = 1;  // as long
};

// The first such transducer; nothing where there is none, or where runs are too short. `without`: as in candidates.h.
std::optional<RunsAway> what_runs_away(const Datasheet& sheet, const std::vector<SegmentedRun>& runs,
                                       const std::vector<SegmentedRun>& holdout,
                                       const std::vector<std::string>& without, const GapOptions::SlowDrift& options);

// By how much, in words.
std::string told(const Datasheet& sheet, const RunsAway& found);

}  // namespace faultline
