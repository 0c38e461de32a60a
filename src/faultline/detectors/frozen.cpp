// Frozen: a noisy transducer that gives the very same number `count` times on end. Where noise is well above the
// resolution two equal numbers in a row are rare (probability p) and n of them p^(n-1).   Settings: quantity, count,
// release_time, armed_by, armed_above (arming.h); low, high: ends of the transducer's range, at which readings do not
// count. No size. Blind where the signal is rounded coarser than its noise.
#include <limits>

#include "faultline/detectors/arming.h"
#include "faultline/detectors/persistence.h"

namespace faultline {
namespace {

class Frozen : public Detector {
 public:
  explicit Frozen(const Settings& s)
      : quantity_(s.word("quantity")),
        arming_(s),
        low_(s.number_or("low", -std::numeric_limits<double>::infinity(), -1e300, 1e300)),
        high_(s.number_or("high", std::numeric_limits<double>::infinity(), -1e300, 1e300)),
        count_(static_cast<int>(s.number("count", 2, 1e6))),
        persistence_(0, s.number("release_time", 0, kLongest)) {}

  void reset() override {
    started_ = false;
    persistence_.reset();
  }

  void process(const Estimate& estimate, Detection& detection) override {
    if (!started_ || estimate.restarted) {
      at_ = find_quantity(estimate, quantity_);
      arming_.find(estimate);
      started_ = true;
      same_ = 0;
      persistence_.reset();
    }
    const double value = estimate.quantities[at_].value;
    if (same_ == 0 || value != last_ || value <= low_ || value >= high_ || !arming_.armed(estimate)) {
      same_ = 0;
      since_ = estimate.time;
    }
    last_ = value;
    ++same_;
    const bool was = detection.active;
    const bool active = persistence_.update(estimate.time, same_ >= count_);
    if (active && !was) begin_ = since_;
    detection = Detection();
    detection.active = active;
    detection.since = active ? begin_ : 0;
    detection.confidence = active ? 1 : 0;
  }

 private:
  std::string quantity_;
  Arming arming_;
  double low_, high_;
  int count_;
  Persistence persistence_;
  bool started_ = false;
  std::size_t at_ = 0;
  int same_ = 0;
  double last_ = 0, since_ = 0, begin_ = 0;
};

FAULTLINE_DETECTOR(frozen, {"frozen", make_detector_of<Frozen>});

}  // namespace
}  // namespace faultline
