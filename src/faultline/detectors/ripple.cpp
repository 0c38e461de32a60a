// Ripple: a quantity that swings to and fro around its mean.
//   mean' = (x - mean)/average; a swing is a passage from below mean - limit to above mean + limit, or back
//   condition: at least `swings` of them within the last `average` s, none of them alone longer than that
// A step or a drift makes one swing at most. Settings: quantity, limit (in its unit), swings, average (s), noise (the
// quantity's own sigma), armed_by, armed_above (arming.h), release_time.
// Where the noise is more than `noise`, by the second differences of the last samples (own_level.h), `limit` grows with
// it.
// Size: amplitude, sqrt(2 (variance - noise^2)) since it began, for a sine; bounds from the number of swings seen.
#include <algorithm>
#include <cmath>

#include "faultline/detectors/arming.h"
#include "faultline/detectors/persistence.h"
#include "faultline/numerics/quantiles.h"
#include "faultline/signal/own_level.h"

namespace faultline {
namespace {

constexpr double kWidest = 25;  // five times the noise

class Ripple : public Detector {
 public:
  explicit Ripple(const Settings& s)
      : quantity_(s.word("quantity")),
        arming_(s),
        limit_(s.number("limit", 1e-300, 1e12)),
        swings_(s.number("swings", 2, 1e6)),
        average_(s.number("average", kShortest, kLongest)),
        noise_(s.number("noise", 0, 1e12)),
        own_(noise_ * noise_, kWidest),
        persistence_(0, s.number("release_time", 0, kLongest)) {}

  void reset() override {
    started_ = false;
    own_ = OwnLevel(noise_ * noise_, kWidest);
    persistence_.reset();
  }

  void process(const Estimate& estimate, Detection& detection) override {
    if (!started_ || estimate.restarted) {
      at_ = find_quantity(estimate, quantity_);
      unit_ = estimate.quantities[at_].unit;
      arming_.find(estimate);
      started_ = true;
      armed_ = false;
      seen_ = 0;
      persistence_.reset();
    }
    const double value = estimate.quantities[at_].value;
    const double second = value - 2 * previous_ + before_;
    before_ = previous_;
    previous_ = value;
    seen_ = std::isfinite(second) ? seen_ + 1 : 0;
    if (seen_ > 2) own_.follow(second * second / 6);
    if (!arming_.armed(estimate) || !std::isfinite(value)) {
      armed_ = false;
      persistence_.update(estimate.time, false);
      detection = Detection();
      return;
    }
    if (!armed_) {
      armed_ = true;
      mean_ = value;
      side_ = 0;
      count_ = 0;
      last_ = estimate.time;
      age_ = 0;
      forget();
    }
    const double dt = std::max(estimate.time - last_, 0.0);
    last_ = estimate.time;
    age_ += dt;
    mean_ += std::min(1.0, dt / std::max(std::min(age_, average_), dt > 0 ? dt : 1.0)) * (value - mean_);
    const double noise = std::sqrt(own_.level()), limit = noise_ > 0 ? limit_ * noise / noise_ : limit_;
    const double off = value - mean_;
    const int side = off > limit ? 1 : off < -limit ? -1 : side_;
    if (side != side_) {
      // Too long since the last: not a swing but a shift.
      count_ = side_ != 0 && estimate.time - turned_ <= average_ ? count_ + 1 : 0;
      if (count_ == 0) begin_ = estimate.time, forget();
      turned_ = estimate.time;
      side_ = side;
    }
    if (side_ != 0 && estimate.time - turned_ > average_) side_ = 0, count_ = 0;
    rows_ += 1;
    squares_ += off * off;
    const bool active = persistence_.update(estimate.time, count_ >= swings_);
    detection = Detection();
    if (!active) return;
    detection.active = true;
    detection.since = begin_;
    detection.has_size = true;
    detection.size = std::sqrt(2 * std::max(0.0, squares_ / rows_ - noise * noise));
    const double spread = kNinetyPercentSigmas * detection.size / std::sqrt(2.0 * std::max(count_, 1.0));
    detection.low = std::max(0.0, detection.size - spread);
    detection.high = detection.size + spread;
    detection.confidence = 1 - 0.5 * limit / std::max(limit, detection.size);
  }

  std::string size_name() const override { return "amplitude"; }
  std::string size_unit() const override { return unit_; }

 private:
  void forget() { rows_ = squares_ = 0; }

  std::string quantity_, unit_;
  Arming arming_;
  double limit_, swings_, average_, noise_;
  OwnLevel own_;
  Persistence persistence_;
  bool started_ = false, armed_ = false;
  std::size_t at_ = 0;
  int side_ = 0;
  double mean_ = 0, count_ = 0, last_ = 0, age_ = 0, turned_ = 0, begin_ = 0, rows_ = 0, squares_ = 0;
  double previous_ = 0, before_ = 0, seen_ = 0;
};

FAULTLINE_DETECTOR(ripple, {"ripple", make_detector_of<Ripple>});

}  // namespace
}  // namespace faultline
