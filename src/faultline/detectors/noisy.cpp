// Noisy: a transducer whose white noise is larger than it was.
//   v' = (min((x_k - 2 x_{k-1} + x_{k-2})^2/6, limit^2 own^2 window/3) - v)/window;  condition: v > limit^2 own^2
// own^2: the mean of these squares while there is no alarm (own_level.h), from noise^2 to 2 limit^2 noise^2; noise^2
// where they are more than that. So a transducer that is noisier than its datasheet within 1.4 `limit` is one in good
// order, and what is told is that it became noisier, or that it was too noisy from the start.
// What is noisy stays so while v > limit^2 own^2/2: means of a few squares scatter by half of themselves.
// Each square is capped, so that a step, which makes two of them large, is not yet noise; four large ones within the
// window are. Second differences leave slow signals out: a ramp gives nothing, a sine of frequency f gives
// (2 pi f T)^4/6 of its square.
// A rig that is driven as fast as it is sampled has second differences of its own. A filter foresees those: where
// `innovation` names its normalised innovation, the mean square of that one's second differences over 6 must be beyond
// limit^2/2 as well, over three windows (half, since the filter adds to the noise what it does not know of the state).
// What it does not foresee because the model is wrong is not white: over ten windows the mean square must then be at
// least `kWhite` times that of second differences over two samples, x_k - 2 x_k-2 + x_k-4.
// Settings: quantity, noise (its healthy sigma, with rounding), limit, window (samples), armed_by, armed_above
//   (arming.h), minimum_time, release_time; innovation, if the estimator has one.
// Size: sigma of what is added, sqrt(v - own^2), bounds from v having window/1.1 degrees of freedom.
#include <algorithm>
#include <array>
#include <cmath>

#include "faultline/detectors/arming.h"
#include "faultline/detectors/persistence.h"
#include "faultline/numerics/quantiles.h"
#include "faultline/signal/own_level.h"

namespace faultline {
namespace {

constexpr double kStill = 0.5;  // of the limit, of mean squares
constexpr double kWidest = 2;   // limits, likewise: the mean of the first squares is known to a quarter
constexpr double kForeseen = 0.5, kForeseenWindows = 3;  // of the limit, of the innovation
// White noise gives 1, a motion up to two thirds of half the sample rate a third. Ten windows tell it to a fifth.
constexpr double kWhite = 0.45, kWhiteWindows = 10;

class Noisy : public Detector {
 public:
  explicit Noisy(const Settings& s)
      : quantity_(s.word("quantity")),
        innovation_(s.word_or("innovation", "")),
        arming_(s),
        variance_(std::pow(s.number("noise", 1e-300, 1e12), 2)),
        limit_(std::pow(s.number("limit", 1, 1e6), 2)),
        window_(s.number("window", 2, 1e6)),
        persistence_(s.number("minimum_time", 0, kLongest), s.number("release_time", 0, kLongest)) {}

  void reset() override {
    started_ = false;
    own_ = OwnLevel(variance_, kWidest * limit_);
    persistence_.reset();
  }

  void process(const Estimate& estimate, Detection& detection) override {
    if (!started_ || estimate.restarted) {
      at_ = find_quantity(estimate, quantity_);
      unit_ = estimate.quantities[at_].unit;
      if (!innovation_.empty()) innovation_at_ = find_quantity(estimate, innovation_);
      innovation_mean_ = fast_mean_ = slow_mean_ = 0;
      arming_.find(estimate);
      started_ = true;
      rows_ = 0;
      mean_ = own_.level();
      long_mean_ = long_rows_ = 0;
      persistence_.reset();
    }
    const double second = second_.next(estimate.quantities[at_].value), slow = second_.slow();
    const double surprise =
        innovation_.empty() ? 0 : innovation_second_.next(estimate.quantities[innovation_at_].value);
    if (rows_ < (innovation_.empty() ? 2 : 4)) {
      ++rows_;
      detection = Detection();
      return;
    }
    if (!arming_.armed(estimate) || !std::isfinite(second)) {
      mean_ = own_.level();
      rows_ = std::isfinite(second) ? rows_ : 0;
      persistence_.update(estimate.time, false);
      detection = Detection();
      return;
    }
    const double square = second * second / 6;
    const double own = own_.level(), limit = limit_ * own;
    const double capped = std::min(square, limit * window_ / 3);
    mean_ += (capped - mean_) / window_;
    const double still = persistence_.active() ? kStill : 1;
    const bool beyond = mean_ > still * limit && !is_motion(second, slow, surprise, still);
    if (!beyond && !persistence_.active()) own_.follow(capped);
    const bool active = persistence_.update(estimate.time, beyond);
    detection = Detection();
    detection.active = active;
    if (!active) {
      long_mean_ = long_rows_ = 0;
      return;
    }
    // Since it is there, a plain mean of all of it.
    if (beyond) {
      long_rows_ += 1;
      long_mean_ += (square - long_mean_) / long_rows_;
    }
    detection.since = persistence_.since();
    detection.has_size = true;
    const auto added = [own](double v) { return std::sqrt(std::max(0.0, v - own)); };
    // Squares of second differences have a relative standard deviation of 1.41, neighbours being alike for some 3
    // samples.
    const double spread = kNinetyPercentSigmas * 1.41 * std::sqrt(3 / std::max(long_rows_, 3.0));
    detection.size = added(long_mean_);
    detection.low = added(long_mean_ / (1 + spread));
    detection.high = added(long_mean_ * (1 + spread));
    detection.confidence = 1 - 0.5 * limit / std::max(limit, mean_);
  }

  std::string size_name() const override { return "std"; }
  std::string size_unit() const override { return unit_; }

 private:
  struct SecondDifference {
    std::array<double, 5> values{};  // the latest first
    double next(double value) {
      std::copy_backward(values.begin(), values.end() - 1, values.end());
      values[0] = value;
      return values[0] - 2 * values[1] + values[2];
    }
    double slow() const { return values[0] - 2 * values[2] + values[4]; }
  };

  // Whether the filter foresees it, or it is not white.
  bool is_motion(double second, double slow, double surprise, double still) {
    if (innovation_.empty() || !std::isfinite(surprise + slow)) return false;
    const double most = limit_ * window_ / 3;
    innovation_mean_ += (std::min(surprise * surprise / 6, most) - innovation_mean_) / (kForeseenWindows * window_);
    fast_mean_ += (second * second - fast_mean_) / (kWhiteWindows * window_);
    slow_mean_ += (slow * slow - slow_mean_) / (kWhiteWindows * window_);
    return innovation_mean_ <= still * kForeseen * limit_ || fast_mean_ < kWhite * slow_mean_;
  }

  std::string quantity_, innovation_, unit_;
  Arming arming_;
  double variance_, limit_, window_;  // limit_: of mean squares
  OwnLevel own_{variance_, kWidest* limit_};
  Persistence persistence_;
  bool started_ = false;
  std::size_t at_ = 0, innovation_at_ = 0;
  int rows_ = 0;
  SecondDifference second_, innovation_second_;
  double mean_ = 0, innovation_mean_ = 0, fast_mean_ = 0, slow_mean_ = 0, long_mean_ = 0, long_rows_ = 0;
};

FAULTLINE_DETECTOR(noisy, {"noisy", make_detector_of<Noisy>});

}  // namespace
}  // namespace faultline
