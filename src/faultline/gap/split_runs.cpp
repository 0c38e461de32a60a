#include "faultline/gap/split_runs.h"

#include <fmt/format.h>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

std::vector<SegmentedRun> cut_in_two(const Datasheet& sheet, const SegmentedRun& run, const SegmentOptions& options) {
  std::vector<SegmentedRun> parts;
  const std::size_t rows = run.recording.rows();
  const std::size_t middle = rows / 2;
  for (int half = 0; half < 2; ++half) {
    Recording part;
    part.rig = run.recording.rig;
    part.channels = run.recording.channels;
    for (std::size_t k = half ? middle : 0; k < (half ? rows : middle); ++k) part.append(run.measured(k));
    parts.push_back(cut_run(sheet, run.name + (half ? " (second half)" : " (first half)"), std::move(part),
                            static_cast<double>(run.segment) * run.period, options));
  }
  return parts;
}

}  // namespace

SplitRuns split_runs(const Datasheet& sheet, std::vector<SegmentedRun> runs, std::vector<SegmentedRun> holdout,
                     const SegmentOptions& options) {
  if (runs.empty()) throw InputError("gap: no run was given");
  SplitRuns split;
  if (runs.size() == 1 && holdout.empty()) {
    const std::size_t least = 4 * runs.front().segment;  // two segments in each half
    if (runs.front().recording.rows() < least)
      throw InputError(fmt::format("{}: too short to be cut in two; a single run needs at least {:g} s",
                                   runs.front().name, static_cast<double>(least) * runs.front().period));
    runs = cut_in_two(sheet, runs.front(), options);
  }
  for (std::size_t i = 0; i < runs.size(); ++i) split.learn.push_back(i);
  if (!holdout.empty()) {
    Fold fold;
    fold.train = split.learn;
    for (std::size_t i = 0; i < holdout.size(); ++i) fold.test.push_back(runs.size() + i);
    split.folds = {fold};
  } else {
    Fold even, odd;
    for (const std::size_t i : split.learn) {
      (i % 2 ? odd : even).train.push_back(i);
      (i % 2 ? even : odd).test.push_back(i);
    }
    split.folds = {even, odd};
  }
  for (SegmentedRun& run : holdout) runs.push_back(std::move(run));
  split.runs = std::move(runs);
  return split;
}

}  // namespace faultline
