// Displacement ripple: pump flow times 1 + amplitude sin(order angle + phase).
//
// amplitude [1]: relative; order [1], pulses per turn (pistons or teeth), and phase [rad], shapes. angle: of the shaft,
// rad, from where it stood when the recording began.
// Smooth, linear in `amplitude`. Limit: one harmonic; a real pump has several.

#include <cmath>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

constexpr double kPi = 3.141592653589793;

class DisplacementRipple : public Effect {
 public:
  double delivery(double flow, double shaft_angle) const override {
    return flow * (1 + parameter(0) * std::sin(parameter(1) * shaft_angle + parameter(2)));
  }
};

}  // namespace

FAULTLINE_EFFECT(displacement_ripple, {"displacement_ripple",
                                       "source",
                                       "pump flow (1 + amplitude sin(order shaft angle + phase))",
                                       {PortKind::source},
                                       {{"amplitude", "1", 0, 0, 1},
                                        {"order", "1", kNoShape, 1, 100},
                                        {"phase", "rad", kNoShape, -kPi, kPi, 0}},
                                       &make_effect<DisplacementRipple>});

}  // namespace faultline
