// Hysteresis. On a signal the play operator: y follows u at a distance of at most width/2,
//   y = min(max(y_before, u - width/2), u + width/2).
// On a body a rate-independent force of total loop width `width`, elastic over +-5 % of the port's range,
//   s = min(max(s_before + x - x_before, -r), r),  F = (width/2) s/r,  r = 0.05 range (Prandtl's element).
//
// width [of what passes; N or N m at a force port]: total width of the loop. The signal starts at its first value, the
// force at 0 at the first position. Continuous in u and x; linear in width for the force.
// The force remembers the last position it was asked for: trial steps of an integrator within one step are retraced
// exactly while elastic, and while sliding leave an error no larger than their own overshoot over r.
// A signal is undone by the side on which it moves; at rest by what a model has within the play, or by the side of its
// last motion.
// Limit: one element, so a loop of one shape; minor loops of a magnetic coil are rounder.

#include <algorithm>
#include <cmath>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class Hysteresis : public Effect {
 public:
  void reset() override { started_ = false; }

  double signal(double value, double /*time*/) override {
    const double half = 0.5 * parameter(0);
    if (!started_) memory_ = value;
    started_ = true;
    memory_ = std::min(std::max(memory_, value - half), value + half);
    return memory_;
  }
  Shown undo(const Course& out, double later, double /*time*/, double own) const override {
    Shown in = out(later);
    const double half = 0.5 * parameter(0);
    if (std::fabs(in.slope) > kCertain * in.slope_std)
      in.value += std::copysign(half, in.slope);
    else if (std::isfinite(own))
      in.value = std::min(std::max(own, in.value - half), in.value + half);
    else
      in.value += half * last_motion(out, later, in.value);
    return in;
  }
  bool remembers() const override { return true; }
  bool resumes_by_values() const override { return true; }
  void resume(const Shown& /*in*/, const Shown& out) override {
    memory_ = out.value;
    started_ = true;
  }

  void force(const Motion& motion, BodyForces& sum) const override {
    if (!started_) {
      memory_ = 0;
      position_ = motion.position;
      started_ = true;
    }
    memory_ = std::min(std::max(memory_ + motion.position - position_, -reach_), reach_);
    position_ = motion.position;
    sum.applied += force_per_metre_ * memory_;
  }

 private:
  static constexpr double kElasticShare = 0.05;
  static constexpr double kCertain = 3;      // standard deviations
  static constexpr int kMostDoublings = 24;  // of the time that is looked back

  // Sign of it; 0: none is to be seen.
  double last_motion(const Course& out, double later, double value) const {
    double back = context().step;
    for (int i = 0; i < kMostDoublings; ++i, back *= 2) {
      const double moved = value - out(later - back).value;
      if (std::isnan(moved)) return 0;
      if (std::fabs(moved) > kCertain * context().noise_std) return std::copysign(1.0, moved);
    }
    return 0;
  }

  void parameters_changed() override {
    reach_ = kElasticShare * context().range;
    force_per_metre_ = reach_ > 0 ? 0.5 * parameter(0) / reach_ : 0;
  }

  double reach_ = 0;
  double force_per_metre_ = 0;
  mutable double memory_ = 0;
  mutable double position_ = 0;
  mutable bool started_ = false;
};

}  // namespace

FAULTLINE_EFFECT(
    hysteresis,
    {"hysteresis",
     "hysteresis",
     "play operator of total width: y = u -+ width/2, once u has moved so far; at a force port a force loop",
     {PortKind::command, PortKind::sensor, PortKind::force},
     {{"width", "port", 0, 0, 1e9}},
     &make_effect<Hysteresis>});

}  // namespace faultline
