// Chooses the noise covariances of an estimator stage from recordings of a healthy rig.
//
//   maximise  sum over samples and rows of  -1/2 (ln s_i^2 + nu_i^2/s_i^2)   nu: innovation, s: its predicted sigma
//
// over the logarithms of R and of those entries of Q whose states have dynamics, one after the other in shrinking
// steps. No step may leave out readings that were used before (guarded_filter.h). At the maximum innovations are as
// white and as large as the filter says. Entries of Q whose states are random walks (faults and corrections that a
// healthy rig does not show) stay: what is right for them is a choice between delay and false alarms
// (threshold_tuning.h). Assumes that the recordings hold the motion for which the filter is meant; a model error is
// taken for noise.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "faultline/estimators/estimator_stage.h"

namespace faultline {

struct InnovationQuality {  // per row of the innovation
  std::string name;
  double consistency =
      0;                 // mean of nu^2/s^2: 1 where the filter is right about itself, below 1 where it is too cautious
  double whiteness = 0;  // correlation of successive nu/s: 0 for white
};

struct NoiseTuning {
  std::vector<double> process_noise, measurement_noise;
  std::vector<bool> walks;  // per state: a random walk, whose entry of Q was kept
  std::vector<InnovationQuality> before, after;
  double likelihood_before = 0, likelihood_after = 0;  // mean per sample
  bool finished = true;                                // false: stopped with the best so far
};

// Whether each state of the stage's model only moves by its process noise.
std::vector<bool> random_walks(const Datasheet& sheet, const StageSpec& stage);

// InputError where the stage has no `process_noise` and `measurement_noise`. `progress` hears the percentage done;
// once `enough` says so the search ends with the best so far.
NoiseTuning tune_noise(const Datasheet& sheet, const StageSpec& stage, const std::vector<Recording>& healthy,
                       const std::function<void(int)>& progress = {}, const std::function<bool()>& enough = {});

}  // namespace faultline
