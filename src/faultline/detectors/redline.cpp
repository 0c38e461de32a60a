// Redline: a measured quantity that stays beyond a fixed margin for a minimum time; what test benches stop by.
// Settings:
//   quantity; margin: in the quantity's unit, or relative_margin: in parts of the expected value
//   expected: the value to stay near; or learn: s over which it is learnt whenever the detector arms anew, or after a
//     gap in the data, in which the bench may have been set otherwise. The first that is learnt is the reference; one
//     that was restored takes its place when the detector arms for the first time.
//   armed_by, armed_above (arming.h), minimum_time, release_time
// Size: the quantity itself while it was last beyond, with no bounds of its own.
#include <algorithm>
#include <cmath>

#include "faultline/detectors/arming.h"
#include "faultline/detectors/persistence.h"

namespace faultline {
namespace {

constexpr int kReferenceVersion = 1;  // the expected value

class Redline : public Detector {
 public:
  explicit Redline(const Settings& s)
      : quantity_(s.word("quantity")),
        arming_(s),
        relative_(s.has("relative_margin")),
        margin_(s.number(relative_ ? "relative_margin" : "margin", 1e-300, 1e12)),
        learn_(s.has("expected") ? 0 : s.number("learn", kShortest, kLongest)),
        given_(learn_ > 0 ? 0 : s.number("expected", -1e12, 1e12)),
        persistence_(s.number("minimum_time", 0, kLongest), s.number("release_time", 0, kLongest)) {}

  void reset() override {
    started_ = false;
    persistence_.reset();
  }

  void process(const Estimate& estimate, Detection& detection) override {
    if (!started_ || estimate.restarted) begin(estimate);
    const double value = estimate.quantities[at_].value;
    if (!arming_.armed(estimate) || !std::isfinite(value)) {
      if (learn_ > 0 && armed_) learning_ = learn_, learnt_ = 0, sum_ = 0;
      persistence_.update(estimate.time, false);
      detection = Detection();
      return;
    }
    armed_ = true;
    if (learning_ > 0) {
      if (learnt_ > 0) learning_ -= std::max(estimate.time - last_, 0.0);
      last_ = estimate.time;
      learnt_ += 1;
      sum_ += value;
      if (learning_ <= 0) {
        if (!reference_) reference_ = sum_ / learnt_;
        set_expected(sum_ / learnt_);
      }
      detection = Detection();
      return;
    }
    const bool beyond = value < low_ || value > high_;
    const bool active = persistence_.update(estimate.time, beyond);
    detection = Detection();
    if (!active) return;
    detection.active = true;
    detection.since = persistence_.since();
    detection.has_size = true;
    if (beyond) beyond_ = value;
    detection.size = detection.low = detection.high = beyond_;
    detection.confidence = 1;
  }

  std::optional<Reference> reference() const override {
    const std::optional<double> known = reference_ ? reference_ : restored_;
    if (!known) return {};
    return Reference{"redline", kReferenceVersion, {quantity_}, {*known}};
  }
  void restore(const Reference& reference) override {
    if (learn_ <= 0) throw InputError("its expected value is given in the datasheet and not learnt");
    check_reference(reference, "redline", kReferenceVersion, {quantity_});
    restored_ = reference.numbers[0];
  }
  std::string size_name() const override { return quantity_; }
  std::string size_unit() const override { return unit_; }

 private:
  void begin(const Estimate& estimate) {
    at_ = find_quantity(estimate, quantity_);
    unit_ = estimate.quantities[at_].unit;
    arming_.find(estimate);
    if (!started_) reference_ = restored_;  // the first that is learnt outlasts a gap in the data
    started_ = true;
    learning_ = learn_;
    learnt_ = sum_ = 0;
    last_ = estimate.time;
    persistence_.reset();
    armed_ = false;
    if (learn_ <= 0) set_expected(given_);
    if (restored_) set_expected(*restored_);
  }
  void set_expected(double expected) {
    const double margin = relative_ ? margin_ * std::abs(expected) : margin_;
    low_ = expected - margin;
    high_ = expected + margin;
    learning_ = 0;
  }

  std::string quantity_, unit_;
  Arming arming_;
  bool relative_;
  double margin_, learn_, given_;
  Persistence persistence_;
  std::optional<double> restored_, reference_;  // expected value: of a run before; the first of this one
  bool started_ = false, armed_ = false;
  std::size_t at_ = 0;
  double learning_ = 0, learnt_ = 0, sum_ = 0, last_ = 0, low_ = 0, high_ = 0, beyond_ = 0;
};

FAULTLINE_DETECTOR(redline, {"redline", make_detector_of<Redline>});

}  // namespace
}  // namespace faultline
