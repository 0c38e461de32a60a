// Which runs are learned from and which judge: held-out runs, or the runs each other, a single one its halves.
#pragma once

#include <cstddef>
#include <vector>

#include "faultline/segments/segmented_run.h"

namespace faultline {

struct Fold {
  std::vector<std::size_t> train, test;  // positions of runs
};

struct SplitRuns {
  std::vector<SegmentedRun> runs;  // held-out ones last
  std::vector<std::size_t> learn;
  std::vector<Fold> folds;
};

// Throws InputError without a run, and where a single one is too short to be cut in two.
SplitRuns split_runs(const Datasheet& sheet, std::vector<SegmentedRun> runs, std::vector<SegmentedRun> holdout,
                     const SegmentOptions& options);

}  // namespace faultline
