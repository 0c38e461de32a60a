// One estimator of a rig, from samples to estimates: gates what is not fit to be used, restarts on time jumps, runs the
// estimator inside (estimator.h), whatever its type.
// The nodes and the offline program call this same code in the same order.
//
// Gating: a measured channel that is missing or out of its range is left out of the correction; a driving channel holds
// its last good value. A sample whose time is no number, or is not newer than the last, is not used (process returns
// false) unless time jumped back by more than `jump`, or forward by more than `gap`: then everything begins anew with
// that sample. Without settings both are 100 periods and 0.1 s at the least, `gap` what the estimator bridges
// (estimator.h) where that is more. The rig's first stage also says of channels that are used whether they look like
// their transducers' (channel_watch.h).
#pragma once

#include <memory>
#include <vector>

#include "faultline/estimators/channel_watch.h"
#include "faultline/estimators/estimator.h"
#include "faultline/signal/sample.h"

namespace faultline {

struct EstimatorCounts {
  std::uint64_t used = 0, stale = 0, restarts = 0, missing = 0, out_of_range = 0;
};

class EstimatorStage {
 public:
  EstimatorStage(const Datasheet& sheet, const StageSpec& spec);

  // Writes the estimate after this sample; false if the sample was not used. Time, sequence, restarted and
  // channel_status are always those of the sample; the rest stays as it was where there is no news. Without news only
  // the first call allocates.
  bool process(const Sample& sample, Estimate& estimate);
  void reset();
  // Whether the last sample that was used left anything to tell.
  bool news() const { return news_; }
  const EstimatorCounts& counts() const { return counts_; }
  const std::string& name() const { return name_; }
  std::vector<State> states() const { return estimator_->states(); }
  // What the innovation runs over.
  std::vector<std::string> innovation_names() const { return estimator_->innovation_names(); }
  std::optional<Reference> reference() const { return estimator_->reference(); }
  void restore(const Reference& reference) { estimator_->restore(reference); }
  std::vector<HistogramView> histograms() const { return estimator_->histograms(); }

 private:
  void begin(const Sample& sample);

  std::string name_;
  std::vector<Channel> channels_;
  double period_;
  double gap_, jump_;  // s
  std::unique_ptr<Estimator> estimator_;
  std::vector<double> held_;
  std::vector<ChannelStatus> usable_;  // of this sample: good, missing or out of range
  std::vector<ChannelWatch> watches_;  // one per channel; none but in the first stage
  bool running_ = false, news_ = true;
  double last_time_ = 0;
  EstimatorCounts counts_;
};

// What `references` hold of this stage, if anything. InputError, which names file and stage, where it does not fit.
void restore_stage(const References& references, EstimatorStage& stage);

}  // namespace faultline
