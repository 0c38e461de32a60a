// Innovation test: the mean square of a normalised innovation (one, if the filter is right) over about `window`
// samples.
// Source: Mehra, Peschon, "An innovations approach to fault detection and diagnosis in dynamic systems", Automatica 7
// (1971).
//   mean += (x^2 - mean)/window;  with nu = 2 window - 1 the mean is chi-squared/nu (first two moments);
//   alarm above its quantile
// Settings: quantity (normalised); window (samples); false_alarms_per_hour at one sample every `period` s, counting
//   every sample as a test of its own, which is on the safe side; noise: the quantity's own sigma on a healthy rig, 1
//   if its filter is exact; armed_by, armed_above (arming.h), minimum_time, release_time.
// Size: the mean over noise^2.
#include <algorithm>
#include <cmath>

#include "faultline/detectors/arming.h"
#include "faultline/detectors/persistence.h"
#include "faultline/numerics/quantiles.h"

namespace faultline {
namespace {

constexpr double kHour = 3600;  // s

class InnovationTest : public Detector {
 public:
  explicit InnovationTest(const Settings& s)
      : quantity_(s.word("quantity")),
        arming_(s),
        window_(s.number("window", 2, 1e7)),
        weight_(1 / std::pow(s.number("noise", 1e-12, 1e12), 2)),
        persistence_(s.number("minimum_time", 0, kLongest), s.number("release_time", 0, kLongest)) {
    const double tests = kHour / s.number("period", 1e-6, 1e3);
    const double freedom = 2 * window_ - 1;
    limit_ = chi_squared_quantile_above(freedom, std::min(0.5, s.number("false_alarms_per_hour", 1e-9, 1e6) / tests)) /
             freedom;
  }

  void reset() override {
    started_ = false;
    persistence_.reset();
  }

  void process(const Estimate& estimate, Detection& detection) override {
    if (!started_ || estimate.restarted) {
      at_ = find_quantity(estimate, quantity_);
      arming_.find(estimate);
      started_ = true;
      mean_ = 1;
      persistence_.reset();
    }
    const double value = estimate.quantities[at_].value;
    if (!arming_.armed(estimate) || !std::isfinite(value)) {
      mean_ = 1;
      persistence_.update(estimate.time, false);
      detection = Detection();
      return;
    }
    mean_ += (weight_ * value * value - mean_) / window_;
    const bool active = persistence_.update(estimate.time, mean_ > limit_);
    detection = Detection();
    if (!active) return;
    detection.active = true;
    detection.since = persistence_.since();
    detection.has_size = true;
    detection.size = detection.low = detection.high = mean_;
    detection.confidence = 1 - 0.5 * limit_ / std::max(limit_, mean_);
  }

  std::string size_name() const override { return quantity_; }
  std::string size_unit() const override { return "1"; }

 private:
  std::string quantity_;
  Arming arming_;
  double window_, weight_, limit_ = 0;
  Persistence persistence_;
  bool started_ = false;
  std::size_t at_ = 0;
  double mean_ = 1;
};

FAULTLINE_DETECTOR(innovation_test, {"innovation_test", make_detector_of<InnovationTest>});

}  // namespace
}  // namespace faultline
