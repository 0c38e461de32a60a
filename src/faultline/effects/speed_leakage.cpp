// Speed-dependent leakage: q = coefficient |w| dp, a pump's or motor's leak that grows with shaft speed.
//
// coefficient [m^3/(rad Pa)], w in rad/s. Odd in dp, even in w, dissipative; a kink at w = 0. Linear in `coefficient`.
// Limit: nothing at standstill; the leak that remains there is laminar_leakage.

#include <cmath>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class SpeedLeakage : public Effect {
 public:
  double flow(const LeakPath& path) const override {
    return parameter(0) * std::fabs(path.shaft_speed) * path.pressure_drop;
  }
};

}  // namespace

FAULTLINE_EFFECT(speed_leakage, {"speed_leakage",
                                 "leakage",
                                 "coefficient |shaft speed| dp",
                                 {PortKind::flow},
                                 {{"coefficient", "m^3/(rad Pa)", 0, 0, 1e3}},
                                 &make_effect<SpeedLeakage>});

}  // namespace faultline
