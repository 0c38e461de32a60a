// One estimator of a rig, from samples to estimates: gates what is not fit to be used, restarts on time jumps, runs the filter or
// the bank of least squares inside (stage_core.h).
// The nodes and the offline program call this same code in the same order.
//
// Gating: a measured channel that is missing or out of its range is left out of the correction; a driving channel holds its last
// good value. A sample whose time is no number, or is not newer than the last, is not used (process returns false) unless time jumped
// back by more than `jump`, or forward by more than `gap`: then everything begins anew with that sample.
#pragma once

#include <memory>
#include <vector>

#include "faultline/estimators/stage_core.h"
#include "faultline/signal/sample.h"

namespace faultline {

struct EstimatorCounts {
  std::uint64_t used = 0, stale = 0, restarts = 0, missing = 0, out_of_range = 0;
};

class EstimatorStage {
 public:
  EstimatorStage(const Datasheet& sheet, const StageSpec& spec);

  // Writes the estimate after this sample; false if the sample was not used. Allocates only on the first call.
  bool process(const Sample& sample, Estimate& estimate);
  void reset();
  // Whether the last sample that was used left anything to tell; else the estimate is still that of the last news. Always true where
  // no stage of the rig speaks at every sample: the alarms need one that tells the time and the state of the channels.
  bool news() const { return news_; }
  const EstimatorCounts& counts() const { return counts_; }
  const std::string& name() const { return name_; }
  std::vector<State> states() const { return core_->states(); }
  std::vector<std::string> innovation_names() const {
    return core_->innovation_names();
  }  // what the innovation runs over

 private:
  void begin(const Sample& sample);

  std::string name_;
  std::vector<Channel> channels_;
  double period_;
  double gap_, jump_;  // s
  std::unique_ptr<StageCore> core_;
  std::vector<double> held_;
  bool running_ = false, news_ = true, always_ = false;
  double last_time_ = 0;
  EstimatorCounts counts_;
};

// Whether a stage of the rig speaks only when it has news; the others speak at every sample.
bool speaks_on_news_only(const Datasheet& sheet, const StageSpec& spec);

}  // namespace faultline
