// Flexible memory: y = u + gain (m - u), time_constant m' = u - m: one state that may pull either way.
//
// gain [1]: 1 is a lag, negative is a lead, between them a share of both. time_constant [s], a shape. Discretised
// exactly for an input held over the step. Undone by m' = (y - m)/((1 - gain) time_constant) over the past - over what
// comes where that is negative -, u = (y - gain m)/(1 - gain); near gain 1, u = y + gain time_constant y'. Linear in
// `gain`. No rig is said to have it: the gap diagnoser uses it to
// find what a memory at a place could win (its closure), so no datasheet lists it.

#include <cmath>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class FlexibleMemory : public Effect {
 public:
  void reset() override { started_ = false; }

  double signal(double value, double /*time*/) override {
    if (!started_) state_ = value;
    state_ += share_ * (value - state_);
    started_ = true;
    return value + parameter(0) * (state_ - value);
  }
  Shown undo(const Course& out, double later, double /*time*/, double /*own*/) const override {
    Shown in = out(later);
    const double gain = parameter(0), rest = 1 - gain;
    if (std::fabs(rest) < kNearOne) {
      in.value += gain * parameter(1) * in.slope;
      in.std = std::hypot(in.std, gain * parameter(1) * in.slope_std);
      return in;
    }
    const double step = rest * parameter(1) / kPerTime;  // backwards where positive
    double sum = 0.5 * in.value, weights = 0.5, last = in.value;
    for (int i = 1; i <= kTimes * kPerTime; ++i) {
      const double value = out(later - i * step).value;
      if (std::isfinite(value)) last = value;
      const double weight = std::exp(-static_cast<double>(i) / kPerTime);
      sum += weight * last;
      weights += weight;
    }
    in.value = (in.value - gain * sum / weights) / rest;
    in.std /= std::fabs(rest);
    return in;
  }
  bool remembers() const override { return true; }
  void resume(const Shown& in, const Shown& out) override {
    state_ = parameter(0) == 0 ? in.value : in.value + (out.value - in.value) / parameter(0);
    started_ = true;
  }

 private:
  static constexpr double kNearOne = 0.2;  // of the gain: nearer, the quotient has more noise than the slope
  static constexpr int kPerTime = 8, kTimes = 5;

  void parameters_changed() override { share_ = -std::expm1(-context().step / parameter(1)); }

  double share_ = 1;
  double state_ = 0;
  bool started_ = false;
};

}  // namespace

FAULTLINE_EFFECT(flexible_memory, {"flexible_memory",
                                   "flexible",
                                   "u + gain (m - u), time_constant m' = u - m",
                                   {PortKind::command, PortKind::sensor},
                                   {{"gain", "1", 0, -2, 2}, {"time_constant", "s", kNoShape, 1e-5, 1e3}},
                                   &make_effect<FlexibleMemory>});

}  // namespace faultline
