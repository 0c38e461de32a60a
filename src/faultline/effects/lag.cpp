// Lag: time_constant dy/dt = u - y, a first-order low pass.
//
// time_constant [s]. Discretised exactly for an input held over the step h: y += (1 - exp(-h/time_constant)) (u - y).
// y starts at the first value (no start-up transient). Continuous in time_constant down to 0, where y = u.
// Limit: the value at the end of the held step is passed on at its start, at most one step early.

#include <cmath>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class Lag : public Effect {
 public:
  void reset() override { started_ = false; }

  double signal(double value, double /*time*/) override {
    if (!started_ || share_ >= 1)
      state_ = value;
    else
      state_ += share_ * (value - state_);
    started_ = true;
    return state_;
  }

 private:
  void parameters_changed() override { share_ = parameter(0) > 0 ? -std::expm1(-context().step / parameter(0)) : 1; }

  double share_ = 1;
  double state_ = 0;
  bool started_ = false;
};

}  // namespace

FAULTLINE_EFFECT(lag, {"lag",
                       "lag",
                       "time_constant y' = u - y",
                       {PortKind::command, PortKind::sensor},
                       {{"time_constant", "s", 0, 0, 1e3}},
                       &make_effect<Lag>});

}  // namespace faultline
