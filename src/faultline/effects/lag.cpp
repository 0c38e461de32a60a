// Lag: time_constant dy/dt = u - y, a first-order low pass.
//
// time_constant [s]. Discretised exactly for an input that runs straight from one step h to the next, e =
// exp(-h/time_constant):
//   y += (1 - e)(u_before - y) + (1 - (1 - e) time_constant/h)(u - u_before)
// so that the lag of a signal that moves is the time constant, however short. y starts at the first value (no start-up
// transient). Continuous in time_constant down to 0, where y = u. Undone as u = y + time_constant y', with that much of
// the
// slope's error.

#include <cmath>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class Lag : public Effect {
 public:
  void reset() override { started_ = false; }

  double signal(double value, double /*time*/) override {
    if (!started_)
      state_ = value;
    else
      state_ += held_ * (before_ - state_) + straight_ * (value - before_);
    before_ = value;
    started_ = true;
    return state_;
  }
  Shown undo(const Course& out, double later, double /*time*/, double /*own*/) const override {
    Shown in = out(later);
    in.value += parameter(0) * in.slope;
    in.std = std::hypot(in.std, parameter(0) * in.slope_std);
    return in;
  }
  bool remembers() const override { return true; }
  bool resumes_by_values() const override { return true; }
  void resume(const Shown& in, const Shown& out) override {
    state_ = out.value;
    before_ = in.value;
    started_ = true;
  }

 private:
  void parameters_changed() override {
    if (parameter(0) <= 0) {
      held_ = straight_ = 1;
      return;
    }
    const double steps = context().step / parameter(0);
    held_ = -std::expm1(-steps);
    straight_ = steps > 1e-4 ? 1 - held_ / steps : steps / 2 - steps * steps / 6;
  }

  double held_ = 1, straight_ = 1;  // shares of the step before and of the way since
  double state_ = 0, before_ = 0;
  bool started_ = false;
};

}  // namespace

FAULTLINE_EFFECT(lag, {"lag",
                       "lag",
                       "time_constant y' = u - y",
                       {PortKind::command, PortKind::sensor},
                       {{"time_constant", "s", 0, 0, 1e6}},
                       &make_effect<Lag>});

}  // namespace faultline
