// Second-order lag: y'' + 2 damping w y' + w^2 y = w^2 u,  w = natural_frequency.
//
// natural_frequency [rad/s], grows from infinity as 1/size; damping [1], a shape: below 1 it overshoots. Discretised
// exactly for an input that runs straight from one step to the next, by the matrix exponential of [0 1; -1 -2 damping]
// over w h, at every damping and however fast. Starts at rest at the first value. Undone as u = y + 2 damping y'/w +
// y''/w^2, y'' from the slopes around.
// Limit: above about 0.9 damping it is like a lag of 2 damping/w.

#include <algorithm>
#include <cmath>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class SecondOrderLag : public Effect {
 public:
  void reset() override { started_ = false; }

  double signal(double value, double /*time*/) override {
    if (!started_) {
      state_ = value;
      speed_ = 0;
    } else {
      // Beside a straight input the lag runs parallel, 2 damping/w late.
      const double slope = (value - before_) * per_step_;
      const double off = state_ - before_ + 2 * parameter(1) * slope, faster = speed_ - slope;
      state_ = value - 2 * parameter(1) * slope + (kept_ + parameter(1) * turned_) * off + turned_ * faster;
      speed_ = slope - turned_ * off + (kept_ - parameter(1) * turned_) * faster;
    }
    before_ = value;
    started_ = true;
    return state_;
  }
  Shown undo(const Course& out, double later, double /*time*/, double /*own*/) const override {
    Shown in = out(later);
    const double apart = std::max(context().step, kApart * period_);
    const double bend = (out(later + apart).slope - out(later - apart).slope) / (2 * apart);
    in.value += 2 * parameter(1) * period_ * in.slope;
    double bend_std = 0;
    if (std::isfinite(bend)) {
      in.value += period_ * period_ * bend;
      bend_std = in.slope_std / (std::sqrt(2.0) * apart);
    }
    in.std = std::hypot(in.std, 2 * parameter(1) * period_ * in.slope_std, period_ * period_ * bend_std);
    return in;
  }
  bool remembers() const override { return true; }
  void resume(const Shown& in, const Shown& out) override {
    state_ = out.value;
    speed_ = period_ * out.slope;
    before_ = in.value;
    started_ = true;
  }

 private:
  static constexpr double kApart = 0.3;  // of 1/w: the second slope is then 2 % off at the natural frequency

  void parameters_changed() override {
    period_ = 1 / parameter(0);
    const double damping = parameter(1), angle = context().step / period_;
    per_step_ = period_ / context().step;
    const double root = std::sqrt(std::fabs(1 - damping * damping));
    kept_ = turned_ = 0;
    if (!std::isfinite(angle)) return;
    if (root * angle < 1e-9) {
      kept_ = std::exp(-damping * angle);
      turned_ = angle * kept_;
    } else if (damping < 1) {
      kept_ = std::exp(-damping * angle) * std::cos(root * angle);
      turned_ = std::exp(-damping * angle) * std::sin(root * angle) / root;
    } else {
      const double slow = std::exp(-angle / (damping + root)), fast = std::exp(-(damping + root) * angle);
      kept_ = (slow + fast) / 2;
      turned_ = (slow - fast) / (2 * root);
    }
  }

  double period_ = 0;             // s, 1/w
  double per_step_ = 0;           // 1/(w h)
  double kept_ = 0, turned_ = 0;  // exp(-damping w h) cos(.), exp(-damping w h) sin(.)/.: of the distance to it
  double state_ = 0, speed_ = 0;  // y, y'/w
  double before_ = 0;
  bool started_ = false;
};

}  // namespace

FAULTLINE_EFFECT(second_order_lag,
                 {"second_order_lag",
                  "lag",
                  "y'' + 2 damping w y' + w^2 y = w^2 u, w = natural_frequency",
                  {PortKind::command, PortKind::sensor},
                  {{"natural_frequency", "rad/s", kInfinity, 1e-6, kInfinity}, {"damping", "1", kNoShape, 0.02, 50}},
                  &make_effect<SecondOrderLag>});

}  // namespace faultline
