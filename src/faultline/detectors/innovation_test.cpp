// Innovation test: the mean square of a normalised innovation (one, if the filter is right) over about `window`
// samples.
// Source: Mehra, Peschon, "An innovations approach to fault detection and diagnosis in dynamic systems", Automatica 7
// (1971).
//   mean += (x^2 - mean)/window;  with nu = 2 window - 1 mean/own is chi-squared/nu (first two moments);
//   alarm above its quantile
// own: the mean square of the rig in good order, whose transducers need not scatter as the filter was told: the least
// of the blocks of kBlock samples so far, so that a filter that is still finding its state does not count. noise^2 to
// kWidest noise^2; while all blocks are beyond that it is the widest, and noise^2 after kPatience of them.
// Settings: quantity (normalised); window (samples); false_alarms_per_hour at one sample every `period` s, counting
//   every sample as a test of its own, which is on the safe side; noise: the quantity's own sigma on a healthy rig, 1
//   if its filter is exact; armed_by, armed_above (arming.h), minimum_time, release_time.
// Size: the mean over own.
#include <algorithm>
#include <cmath>
#include <limits>

#include "faultline/detectors/arming.h"
#include "faultline/detectors/persistence.h"
#include "faultline/numerics/quantiles.h"

namespace faultline {
namespace {

constexpr double kHour = 3600;  // s
constexpr double kWidest = 9;   // three times the noise
// Of an own mean square: it is known to 5 %, and whose noise it is depends on the operating point.
constexpr double kUnsure = 1.25;
constexpr double kBlock = 1000, kPatience = 5;

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
    least_ = std::numeric_limits<double>::infinity();
    blocks_ = block_rows_ = block_ = 0;
    persistence_.reset();
  }

  void process(const Estimate& estimate, Detection& detection) override {
    if (!started_ || estimate.restarted) {
      at_ = find_quantity(estimate, quantity_);
      arming_.find(estimate);
      started_ = true;
      mean_ = rows_ = 0;
      persistence_.reset();
    }
    const double value = estimate.quantities[at_].value;
    if (!arming_.armed(estimate) || !std::isfinite(value)) {
      mean_ = rows_ = 0;
      persistence_.update(estimate.time, false);
      detection = Detection();
      return;
    }
    const double square = weight_ * value * value;
    const double own = this->own();
    ++rows_;
    mean_ += (square - mean_) / std::min(rows_, window_);
    const double limit = limit_ * (own > 1 ? std::min(kUnsure * own, kWidest) : 1);
    add(square);
    const bool active = persistence_.update(estimate.time, rows_ >= window_ && mean_ > limit);
    detection = Detection();
    if (!active) return;
    detection.active = true;
    detection.since = persistence_.since();
    detection.has_size = true;
    detection.size = detection.low = detection.high = mean_ / own;
    detection.confidence = 1 - 0.5 * limit / std::max(limit, mean_);
  }

  std::string size_name() const override { return quantity_; }
  std::string size_unit() const override { return "1"; }

 private:
  double own() const {
    if (least_ <= kWidest) return std::max(least_, 1.0);
    return blocks_ < kPatience ? kWidest : 1;
  }
  void add(double square) {
    block_ += square;
    if (++block_rows_ < kBlock) return;
    least_ = std::min(least_, block_ / kBlock);
    ++blocks_;
    block_ = block_rows_ = 0;
  }

  std::string quantity_;
  Arming arming_;
  double window_, weight_, limit_ = 0;
  Persistence persistence_;
  bool started_ = false;
  std::size_t at_ = 0;
  double mean_ = 0, rows_ = 0;
  double least_ = std::numeric_limits<double>::infinity();  // mean square of a block
  double blocks_ = 0, block_rows_ = 0, block_ = 0;
};

FAULTLINE_DETECTOR(innovation_test, {"innovation_test", make_detector_of<InnovationTest>});

}  // namespace
}  // namespace faultline
