// Overflow: what stands above the rim of a vessel runs over it, slope max(0, upstream - rim), and of that `share`
// arrives at the port's TO side; the rest is lost.
//
// rim [Pa or the port's drop_unit]: upstream pressure (level) when the vessel is full; infinite: it never is. slope
// [m^3/(s Pa)], a shape: so steep that the level stays within a few per cent of the rim. share [1], a shape: 1, all
// arrives. One-way and dissipative; continuous, with a kink. Limit: the share does not depend on the flow; a rig that
// does not ask its port what is arriving() takes all.

#include <algorithm>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class Overflow : public Effect {
 public:
  double flow(const LeakPath& path) const override {
    return parameter(1) * std::max(0.0, path.upstream - parameter(0));
  }
  double arriving_share() const override { return parameter(2); }
};

}  // namespace

FAULTLINE_EFFECT(overflow, {"overflow",
                            "leakage",
                            "slope max(0, upstream - rim), of which share arrives",
                            {PortKind::flow},
                            {{"rim", "Pa", kInfinity, -1e9, kInfinity},
                             {"slope", "m^3/(s Pa)", kNoShape, 1e-15, 1e9},
                             {"share", "1", kNoShape, 0, 1}},
                            &make_effect<Overflow>});

}  // namespace faultline
