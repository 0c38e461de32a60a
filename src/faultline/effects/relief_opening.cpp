// Relief opening: q = slope max(0, dp - cracking_pressure), a relief valve that opens, one way.
//
// cracking_pressure [Pa], of the drop across the valve; infinite: never opens. slope [m^3/(s Pa)].
// Continuous, with a kink at cracking; dissipative. As an effect grows, the cracking pressure comes down as 1/size
// while the slope rises. Limit: no hysteresis between opening and closing, no poppet dynamics.

#include <algorithm>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class ReliefOpening : public Effect {
 public:
  double flow(const LeakPath& path) const override {
    return parameter(1) * std::max(0.0, path.pressure_drop - parameter(0));
  }
};

}  // namespace

FAULTLINE_EFFECT(relief_opening,
                 {"relief_opening",
                  "leakage",
                  "slope max(0, dp - cracking_pressure)",
                  {PortKind::flow},
                  {{"cracking_pressure", "Pa", kInfinity, 0, kInfinity}, {"slope", "m^3/(s Pa)", 0, 0, 1e3}},
                  &make_effect<ReliefOpening>});

}  // namespace faultline
