// Displacement ripple: pump flow times 1 + amplitude sin(order angle).
//
// amplitude [1]: relative; order [1], a shape: pulses per turn (pistons or teeth). angle: of the shaft, rad.
// Smooth, linear in `amplitude`. Limit: one harmonic of fixed phase; a real pump has several.

#include <cmath>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class DisplacementRipple : public Effect {
 public:
  double delivery(double flow, double shaft_angle) const override {
    return flow * (1 + parameter(0) * std::sin(parameter(1) * shaft_angle));
  }
};

}  // namespace

FAULTLINE_EFFECT(displacement_ripple, {"displacement_ripple",
                                       "source",
                                       "pump flow (1 + amplitude sin(order shaft angle))",
                                       {PortKind::source},
                                       {{"amplitude", "1", 0, 0, 1}, {"order", "1", kNoShape, 1, 100}},
                                       &make_effect<DisplacementRipple>});

}  // namespace faultline
