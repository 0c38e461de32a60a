// Deadband: y = u - width/2 above width/2, u + width/2 below -width/2, 0 between.
//
// width [of what passes]: total width. On a signal a controller's or amplifier's dead zone, on a restriction the
// overlap of a valve's lands. Continuous, with kinks; linear in `width` where it responds. Limit: symmetric about zero;
// a shifted zone is an offset before it.

#include <cmath>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class Deadband : public Effect {
 public:
  double signal(double value, double /*time*/) override { return zone(value); }
  double opening(double value) const override { return zone(value); }
  double undo_signal(double value, double /*time*/) const override {  // 0 is all of the zone
    return value == 0 && parameter(0) > 0 ? std::nan("") : value + std::copysign(0.5 * parameter(0), value);
  }

 private:
  double zone(double value) const {
    const double half = 0.5 * parameter(0);
    if (value > half) return value - half;
    if (value < -half) return value + half;
    return 0;
  }
};

}  // namespace

FAULTLINE_EFFECT(deadband, {"deadband",
                            "deadzone",
                            "u - sgn(u) width/2 where |u| > width/2, else 0",
                            {PortKind::command, PortKind::sensor, PortKind::restriction},
                            {{"width", "port", 0, 0, 1e9}},
                            &make_effect<Deadband>});

}  // namespace faultline
