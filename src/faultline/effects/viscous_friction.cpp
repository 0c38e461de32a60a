// Viscous friction: F = coefficient v.
//
// coefficient [N s/m, or N m s/rad on a rotating body]: extra damping. Smooth and linear in v and in `coefficient`.
// Limit: a Newtonian film of constant viscosity; temperature acts through viscosity_drift.

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class ViscousFriction : public Effect {
 public:
  void force(const Motion& motion, BodyForces& sum) const override { sum.viscous += parameter(0) * motion.velocity; }
};

}  // namespace

FAULTLINE_EFFECT(viscous_friction, {"viscous_friction",
                                    "friction",
                                    "-coefficient v",
                                    {PortKind::force},
                                    {{"coefficient", "N s/m or N m s/rad", 0, 0, 1e8}},
                                    &make_effect<ViscousFriction>});

}  // namespace faultline
