// Flexible memory: y = u + gain (m - u), time_constant m' = u - m: one state that may pull either way.
//
// gain [1]: 1 is a lag, negative is a lead, between them a share of both. time_constant [s], a shape. Discretised
// exactly for an input held over the step. Linear in `gain`. No rig is said to have it: the gap diagnoser uses it to
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

 private:
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
