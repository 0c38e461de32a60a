// End stop: a one-sided stiff spring beyond a position, F = stiffness max(0, x - position), against positive motion.
//
// position [m or rad], a shape: where contact begins, towards + only.
// stiffness [N/m or N m/rad]. Continuous, with a kink at contact; linear in `stiffness`.
// Limit: no contact damping, so a free body rebounds with the speed it came with.

#include <algorithm>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class EndStop : public Effect {
 public:
  void force(const Motion& motion, BodyForces& sum) const override {
    sum.applied += parameter(1) * std::max(0.0, motion.position - parameter(0));
  }
};

}  // namespace

FAULTLINE_EFFECT(end_stop, {"end_stop",
                            "load",
                            "-stiffness max(0, x - position)",
                            {PortKind::force},
                            {{"position", "m or rad", kNoShape, -1e3, 1e3}, {"stiffness", "N/m or N m/rad", 0, 0, 1e9}},
                            &make_effect<EndStop>});

}  // namespace faultline
