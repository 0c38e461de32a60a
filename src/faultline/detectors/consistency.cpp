// Consistency: the normalised innovation squared per observed row, averaged, stays below a limit while the model fits.
//   average' = (nis/rows - average)/average_time;  condition: average > limit
// A filter whose R is true has an average of 1; one with a generous R has less, so the limit is set from healthy
// recordings.
#include <algorithm>
#include <cmath>

#include "faultline/detectors/detector.h"
#include "faultline/detectors/persistence.h"

namespace faultline {
namespace {

class Consistency : public Detector {
 public:
  explicit Consistency(const Settings& s)
      : limit_(s.number("limit", 1e-9, 1e9)),
        average_time_(s.number("average", kShortest, kLongest)),
        settle_(s.number("settle", 0, kLongest)),
        persistence_(s.number("minimum_time", 0, kLongest), s.number("release_time", 0, kLongest)) {}

  void reset() override {
    started_ = false;
    persistence_.reset();
  }

  void process(const Estimate& estimate, Detection& detection) override {
    if (!started_ || estimate.restarted) {
      begin_ = last_ = estimate.time;
      mean_ = 0;
      started_ = true;
      persistence_.reset();
    }
    const double dt = std::max(estimate.time - last_, 0.0);
    last_ = estimate.time;
    if (estimate.time - begin_ >= settle_ && estimate.observed > 0)
      mean_ += std::min(1.0, dt / average_time_) * (estimate.normalised_innovation / estimate.observed - mean_);
    detection.active = persistence_.update(estimate.time, mean_ > limit_);
    detection.since = persistence_.since();
    detection.has_size = true;
    detection.size = detection.low = detection.high = mean_;
    detection.confidence = mean_ > limit_ ? 1 - 0.5 * limit_ / mean_ : 0.0;
  }

  Criterion criterion() const override {
    return {started_ && last_ - begin_ >= settle_ ? mean_ : std::nan(""), limit_, "limit", 0};
  }
  std::string size_name() const override { return "normalised_innovation"; }
  std::string size_unit() const override { return "1"; }

 private:
  double limit_, average_time_, settle_;
  Persistence persistence_;
  bool started_ = false;
  double begin_ = 0, last_ = 0, mean_ = 0;
};

FAULTLINE_DETECTOR(consistency, {"consistency", make_detector_of<Consistency>});

}  // namespace
}  // namespace faultline
