// Leak: an estimated leak coefficient that stays above a threshold, beyond what its uncertainty allows.
//
//   mean' = w (C - mean)/average;  w = s0^2/(s0^2 + s^2) where the drive sqrt(dp) exceeds minimum_drive, else 0
// The weight is small where the filter is uncertain (s), and zero where there is hardly a pressure difference: nothing
// flows then whatever the coefficient, so the estimate only drifts.
//   condition: mean > threshold + 2.6 motion_error mean(flow/sqrt(dp)), after `average` s of evidence
// `motion` is the volume flow that the motion itself takes: of it, motion_error (a share, one sigma: the tolerances of
// flow coefficient and area) looks like a leak; 2.6 of them in one rig of 200.
// Size: the mean coefficient times the mean of the drive sqrt(dp), as a volume flow, with 90 % bounds from the
// scatter of the estimate and the datasheet's tolerance of what the estimate rests on (model_error, relative,
// model_floor, absolute, and motion_error).
#include <algorithm>
#include <cmath>

#include "faultline/detectors/detector.h"
#include "faultline/detectors/persistence.h"
#include "faultline/numerics/quantiles.h"

namespace faultline {
namespace {

constexpr double kMotionSigmas = 2.6;  // of motion_error, that no rig without a leak has: 99.5 %

class Leak : public Detector {
 public:
  explicit Leak(const Settings& s)
      : coefficient_(s.word("coefficient")),
        drive_(s.word("drive")),
        motion_(s.word("motion")),
        minimum_drive_(s.number("minimum_drive", 0, 1e6)),
        threshold_(s.number("threshold", 0, 1)),
        release_threshold_(s.number("release_threshold", 0, threshold_)),
        average_(s.number("average", kShortest, kLongest)),
        drive_average_(s.number("drive_average", kShortest, kLongest)),
        settle_(s.number("settle", 0, kLongest)),
        known_std_(s.number("known_std", 1e-30, 1)),
        model_error_(s.number("model_error", 0, 10)),
        model_floor_(s.number("model_floor", 0, 1)),
        motion_error_(s.number("motion_error", 0, 1)),
        persistence_(s.number("minimum_time", 0, kLongest), s.number("release_time", 0, kLongest)) {}

  void reset() override {
    started_ = false;
    persistence_.reset();
  }

  void process(const Estimate& estimate, Detection& detection) override {
    if (!started_ || estimate.restarted) {
      coefficient_at_ = find_quantity(estimate, coefficient_);
      drive_at_ = find_quantity(estimate, drive_);
      motion_at_ = find_quantity(estimate, motion_);
      started_ = true;
      begin_ = last_ = estimate.time;
      mean_ = scatter_ = moved_ = drive_mean_ = seen_ = drive_peak_ = 0;
      persistence_.reset();
    }
    const Quantity& c = estimate.quantities[coefficient_at_];
    const double dt = std::max(estimate.time - last_, 0.0);
    last_ = estimate.time;
    const double drive = estimate.quantities[drive_at_].value;
    // Pressure comes and goes within a stroke: blind is what stays without it.
    drive_peak_ = std::max(drive, drive_peak_ * (1 - std::min(1.0, dt / average_)));
    detection.blind = estimate.time - begin_ >= settle_ && drive_peak_ < minimum_drive_;
    if (estimate.time - begin_ >= settle_) {
      const double weight =
          drive < minimum_drive_ ? 0.0 : known_std_ * known_std_ / (known_std_ * known_std_ + c.std * c.std);
      seen_ += weight * dt;
      // A plain mean until `average` s of evidence are there, then an exponential one.
      const double gain = std::min(1.0, weight * dt / std::max(std::min(seen_, average_), 1e-9));
      const double off = c.value - mean_;
      mean_ += gain * off;
      scatter_ += gain * (off * off - scatter_);
      if (gain > 0) moved_ += gain * (std::abs(estimate.quantities[motion_at_].value) / drive - moved_);
      drive_mean_ +=
          std::min(1.0, dt / std::max(std::min(estimate.time - begin_ - settle_ + dt, drive_average_), 1e-9)) *
          (drive - drive_mean_);
    }
    const double of_motion = motion_error_ * moved_;
    const double std = std::sqrt(std::pow(model_error_ * mean_, 2) + model_floor_ * model_floor_ +
                                 of_motion * of_motion + scatter_ * std::min(1.0, 1.0 / std::max(average_, 1e-9)));
    const double level = persistence_.active() ? release_threshold_ : threshold_;
    const bool holds = seen_ >= average_ && mean_ > level + kMotionSigmas * of_motion;
    detection.active = persistence_.update(estimate.time, holds);
    detection.since = persistence_.since();
    // While a leak that was there fades, its size stays what it was last.
    if (detection.active && !holds) return;
    detection.has_size = true;
    // No leak flows backwards: what is below zero is scatter.
    const double to_flow = drive_mean_;
    detection.per_effect = to_flow;
    detection.size = std::max(0.0, mean_) * to_flow;
    detection.low = std::max(0.0, mean_ - kNinetyPercentSigmas * std) * to_flow;
    detection.high = std::max(0.0, mean_ + kNinetyPercentSigmas * std) * to_flow;
    detection.confidence =
        0.5 * std::erfc(-(mean_ - 0.5 * (threshold_ + kMotionSigmas * of_motion)) / (std * std::sqrt(2.0)));
  }

  Criterion criterion() const override {
    const double value = mean_ - kMotionSigmas * motion_error_ * moved_;
    return {started_ && seen_ >= average_ ? value : std::nan(""), threshold_, "threshold", 0};
  }
  std::string size_name() const override { return "leak_flow"; }
  std::string size_unit() const override { return "m^3/s"; }

 private:
  std::string coefficient_, drive_, motion_;
  double minimum_drive_, threshold_, release_threshold_, average_, drive_average_, settle_, known_std_, model_error_,
      model_floor_, motion_error_;
  Persistence persistence_;
  bool started_ = false;
  std::size_t coefficient_at_ = 0, drive_at_ = 0, motion_at_ = 0;
  double begin_ = 0, last_ = 0, mean_ = 0, scatter_ = 0, moved_ = 0, drive_mean_ = 0, seen_ = 0, drive_peak_ = 0;
};

FAULTLINE_DETECTOR(leak, {"leak", make_detector_of<Leak>});

}  // namespace
}  // namespace faultline
