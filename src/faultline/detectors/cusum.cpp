// CUSUM: the two-sided test of cusum.h on one quantity. Settings:
//   quantity; change: delta, in the quantity's unit, or relative_change: in parts of the reference
//   threshold_changes: lambda in units of delta; or false_alarms_per_hour, from which lambda follows (run_length.h)
//     with the quantity's white noise `noise` (in its unit, or relative_noise in parts of the reference) at one sample
//     every `period` s
//   reference: mu_0; or learn: s over which it is learnt once armed, which a gap in the data does not end; one that was
//     restored takes the place of what would be learnt
//   armed_by, armed_above (arming.h), minimum_time, release_time
// Size: mean of the quantity's offset since the change began; 90 % bounds from its scatter.
#include <algorithm>
#include <cmath>

#include "faultline/detectors/arming.h"
#include "faultline/detectors/cusum.h"
#include "faultline/detectors/persistence.h"
#include "faultline/detectors/run_length.h"
#include "faultline/numerics/quantiles.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kHour = 3600;        // s
constexpr int kReferenceVersion = 1;  // mu_0

class Cusum : public Detector {
 public:
  explicit Cusum(const Settings& s)
      : quantity_(s.word("quantity")),
        arming_(s),
        relative_(s.has("relative_change")),
        change_(s.number(relative_ ? "relative_change" : "change", 1e-300, 1e12)),
        learn_(s.has("reference") ? 0 : s.number("learn", kShortest, kLongest)),
        given_(learn_ > 0 ? 0 : s.number("reference", -1e12, 1e12)),
        persistence_(s.number("minimum_time", 0, kLongest), s.number("release_time", 0, kLongest)) {
    if (s.has("threshold_changes")) {
      threshold_changes_ = s.number("threshold_changes", 1e-6, 1e9);
    } else {
      const double noise = s.number(relative_ ? "relative_noise" : "noise", 1e-300, 1e12);
      const double samples = kHour / s.number("period", 1e-6, 1e3) / s.number("false_alarms_per_hour", 1e-9, 1e6);
      threshold_changes_ = cusum_threshold(0.5 * change_ / noise, samples) * noise / change_;
    }
  }

  void reset() override {
    started_ = false;
    persistence_.reset();
  }

  void process(const Estimate& estimate, Detection& detection) override {
    if (!started_) begin(estimate);
    if (estimate.restarted) go_on();
    const double value = estimate.quantities[at_].value;
    if (!arming_.armed(estimate) || !std::isfinite(value)) {
      test_.reset();
      persistence_.update(estimate.time, false);
      detection = Detection();
      return;
    }
    if (learning_ > 0) {
      learn(estimate, value);
      detection = Detection();
      return;
    }
    const double r = value - reference_;
    const bool beyond = test_.update(r);
    if (test_.steps() <= 1) {
      onset_ = estimate.time;
      sum_ = squares_ = count_ = 0;
    }
    sum_ += r;
    squares_ += r * r;
    count_ += 1;
    const bool was = persistence_.active();
    const bool active = persistence_.update(estimate.time, beyond);
    detection = Detection();
    if (!active) return;
    detection.active = true;
    if (!was) since_ = onset_;
    detection.since = since_;
    detection.has_size = true;
    const double mean = sum_ / count_;
    const double std = std::sqrt(std::max(0.0, squares_ / count_ - mean * mean) / count_);
    detection.size = mean;
    detection.low = mean - kNinetyPercentSigmas * std;
    detection.high = mean + kNinetyPercentSigmas * std;
    detection.confidence = 1 - 0.5 * test_.threshold / std::max(test_.threshold, std::max(test_.up, test_.down));
  }

  std::optional<Reference> reference() const override {
    const bool learnt = learn_ > 0 && started_ && learning_ <= 0;
    if (!learnt && !restored_) return {};
    return Reference{"cusum", kReferenceVersion, {quantity_}, {learnt ? reference_ : *restored_}};
  }
  void restore(const Reference& reference) override {
    if (learn_ <= 0) throw InputError("its reference is given in the datasheet and not learnt");
    check_reference(reference, "cusum", kReferenceVersion, {quantity_});
    restored_ = reference.numbers[0];
  }
  std::string size_name() const override { return quantity_; }
  std::string size_unit() const override { return unit_; }

 private:
  void begin(const Estimate& estimate) {
    at_ = find_quantity(estimate, quantity_);
    unit_ = estimate.quantities[at_].unit;
    arming_.find(estimate);
    started_ = true;
    learning_ = learn_;
    go_on();
    if (learn_ <= 0) set_reference(given_);
    if (restored_) set_reference(*restored_);
  }
  void go_on() {
    if (learning_ > 0) learning_ = learn_;
    learnt_ = sum_ = 0;
    test_.reset();
    persistence_.reset();
  }
  void learn(const Estimate& estimate, double value) {
    if (learnt_ > 0) learning_ -= std::max(estimate.time - last_, 0.0);
    last_ = estimate.time;
    learnt_ += 1;
    sum_ += value;
    if (learning_ <= 0) set_reference(sum_ / learnt_);
  }
  void set_reference(double reference) {
    reference_ = reference;
    learning_ = sum_ = squares_ = count_ = 0;
    const double change = relative_ ? change_ * std::abs(reference) : change_;
    test_.allowance = 0.5 * change;
    test_.threshold = threshold_changes_ * change;
  }

  std::string quantity_, unit_;
  Arming arming_;
  bool relative_;
  double change_, learn_, given_, threshold_changes_ = 0;
  std::optional<double> restored_;  // mu_0
  Persistence persistence_;
  TwoSidedCusum test_;
  bool started_ = false;
  std::size_t at_ = 0;
  double learning_ = 0, learnt_ = 0, last_ = 0, reference_ = 0, onset_ = 0, since_ = 0, sum_ = 0, squares_ = 0,
         count_ = 0;
};

FAULTLINE_DETECTOR(cusum, {"cusum", make_detector_of<Cusum>});

}  // namespace
}  // namespace faultline
