// Band: a quantity whose average leaves [low, high]. For redundancies and balances, which are near zero on a healthy
// rig.
//   average' = (x - average)/average_time;  condition: average < low or average > high
// Size: the average itself, in the quantity's unit. A healthy rig's average may be anywhere in the band, so the bounds
// of what is wrong are the average less its two ends: wider than 90 % where the band was set with room to spare.
#include <algorithm>
#include <cmath>

#include "faultline/detectors/detector.h"
#include "faultline/detectors/persistence.h"

namespace faultline {
namespace {

class Band : public Detector {
 public:
  explicit Band(const Settings& s)
      : quantity_(s.word("quantity")),
        low_(s.number("low", -1e12, 1e12)),
        high_(s.number("high", low_, 1e12)),
        average_time_(s.number("average", kShortest, kLongest)),
        persistence_(s.number("minimum_time", 0, kLongest), s.number("release_time", 0, kLongest)) {}

  void reset() override {
    started_ = false;
    persistence_.reset();
  }

  void process(const Estimate& estimate, Detection& detection) override {
    if (!started_ || estimate.restarted) {
      at_ = find_quantity(estimate, quantity_);
      unit_ = estimate.quantities[at_].unit;
      begin_ = last_ = estimate.time;
      mean_ = 0;
      started_ = true;
      persistence_.reset();
    }
    const double value = estimate.quantities[at_].value;
    const double dt = std::max(estimate.time - last_, 0.0);
    last_ = estimate.time;
    const double age = estimate.time - begin_ + dt;
    const double gain = age > 0 ? std::min(1.0, dt / std::max(std::min(age, average_time_), 1e-9)) : 1.0;
    mean_ += gain * (value - mean_);
    const bool outside = age >= average_time_ && (mean_ < low_ || mean_ > high_);
    detection.active = persistence_.update(estimate.time, outside);
    detection.since = persistence_.since();
    detection.has_size = true;
    detection.size = mean_;
    detection.low = mean_ - std::max(high_, 0.0);
    detection.high = mean_ - std::min(low_, 0.0);
    const double beyond = mean_ > high_ ? mean_ - high_ : mean_ < low_ ? low_ - mean_ : 0.0;
    detection.confidence = beyond > 0 ? 1 - 0.5 * std::exp(-beyond / std::max(high_ - low_, 1e-300)) : 0.0;
  }

  // How far from the middle; `high` is what is told, `low` mirrors it.
  Criterion criterion() const override {
    const double middle = 0.5 * (low_ + high_);
    return {started_ && last_ - begin_ >= average_time_ ? std::abs(mean_ - middle) : std::nan(""), high_ - middle,
            "high", middle};
  }
  std::string size_name() const override { return quantity_; }
  std::string size_unit() const override { return unit_; }

 private:
  std::string quantity_, unit_;
  double low_, high_, average_time_;
  Persistence persistence_;
  bool started_ = false;
  std::size_t at_ = 0;
  double begin_ = 0, last_ = 0, mean_ = 0;
};

FAULTLINE_DETECTOR(band, {"band", make_detector_of<Band>});

}  // namespace
}  // namespace faultline
