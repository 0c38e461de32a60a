// Nominal: an estimated parameter of the rig that is not the datasheet's from the start: another build, exchanged or
// turned channels, another rig's datasheet, or a fault that was there before. Judged once, by the mean of the first
// `learn` s while armed; it then stays, whatever gaps the data have. What changes later is for others.
//   condition: |mean/nominal - 1| > sigmas tolerance
// Settings: quantity, named as the parameter whose nominal value and tolerance count; sigmas; learn [s]; armed_by,
// armed_above (arming.h). Size: the mean, its bounds by the scatter of what it is made of, correlated for all of it.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "faultline/detectors/arming.h"
#include "faultline/numerics/quantiles.h"

namespace faultline {
namespace {

class Nominal : public Detector {
 public:
  Nominal(const Datasheet& sheet, const StageSpec& spec)
      : quantity_(spec.settings.word("quantity")),
        arming_(spec.settings),
        sigmas_(spec.settings.number("sigmas", 1, 100)),
        learn_(spec.settings.number("learn", kShortest, kLongest)) {
    const Parameter& parameter = sheet.parameters[static_cast<std::size_t>(sheet.parameter(quantity_))];
    nominal_ = parameter.nominal;
    tolerance_ = parameter.tolerance;
    if (!(std::abs(nominal_) > 0 && tolerance_ > 0))
      throw InputError(
          fmt::format("{}: {} has no tolerance, so nothing is too far from it", spec.settings.where(), quantity_));
  }

  void reset() override { started_ = false; }

  void process(const Estimate& estimate, Detection& detection) override {
    if (!started_) begin(estimate);
    if (estimate.restarted && !judged_) count_ = mean_ = squares_ = 0;
    const double value = estimate.quantities[at_].value;
    if (!judged_ && arming_.armed(estimate) && std::isfinite(value)) learn(estimate.time, value);
    detection = Detection();
    if (!judged_ || deviation() <= sigmas_) return;
    detection.active = detection.has_size = true;
    detection.since = since_;
    detection.size = mean_;
    const double spread = kNinetyPercentSigmas * std::sqrt(std::max(squares_ / count_, 0.0));
    detection.low = mean_ - spread;
    detection.high = mean_ + spread;
    detection.confidence = 1 - 0.5 * sigmas_ / deviation();
  }

  Criterion criterion() const override { return {judged_ ? deviation() : std::nan(""), sigmas_, "sigmas", 0}; }
  std::string size_name() const override { return quantity_; }
  std::string size_unit() const override { return unit_; }

 private:
  void begin(const Estimate& estimate) {
    at_ = find_quantity(estimate, quantity_);
    unit_ = estimate.quantities[at_].unit;
    arming_.find(estimate);
    started_ = true;
    judged_ = false;
    count_ = mean_ = squares_ = 0;
  }

  void learn(double time, double value) {
    if (count_ == 0) since_ = time;
    const double off = value - mean_;
    mean_ += off / ++count_;
    squares_ += off * (value - mean_);
    judged_ = time - since_ >= learn_;
  }

  double deviation() const { return std::abs(mean_ / nominal_ - 1) / tolerance_; }

  std::string quantity_, unit_;
  Arming arming_;
  double sigmas_, learn_, nominal_ = 0, tolerance_ = 0;
  bool started_ = false, judged_ = false;
  std::size_t at_ = 0;
  double since_ = 0, count_ = 0, mean_ = 0, squares_ = 0;
};

FAULTLINE_DETECTOR(nominal, {"nominal", make_detector_of<Nominal>});

}  // namespace
}  // namespace faultline
