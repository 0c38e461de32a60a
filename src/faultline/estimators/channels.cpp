// channels: no model. Its quantities are the channels as they are measured, each at its last good value, for detectors
// of transducers on a rig that no filter follows. No settings but the stage's.
#include "faultline/estimators/estimator.h"

namespace faultline {
namespace {

class ChannelEstimator : public Estimator {
 public:
  ChannelEstimator(const Datasheet& sheet, const StageSpec&) : channels_(sheet.channels) {}

  std::vector<State> states() const override { return {}; }
  std::vector<std::string> innovation_names() const override { return {}; }
  void begin(const double*) override {}
  bool advance(const double*, const ChannelStatus*, double, int) override { return true; }
  void write(const double* channels, bool, Estimate& estimate) const override {
    if (estimate.quantities.empty())
      for (const Channel& c : channels_) estimate.quantities.push_back({c.name, c.unit, 0, 0});
    for (std::size_t c = 0; c < channels_.size(); ++c) estimate.quantities[c].value = channels[c];
    estimate.observed = 0;
  }

 private:
  std::vector<Channel> channels_;
};

FAULTLINE_ESTIMATOR(channels, {"channels", "kalman", false, make_estimator_of<ChannelEstimator>});

}  // namespace
}  // namespace faultline
