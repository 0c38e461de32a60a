// Coulomb friction: F = force sgn(v), at rest anything up to `force`.
//
// force [N, or N m on a rotating body]: extra level, the same in both directions, moving and at rest.
// The force is set-valued at v = 0; the rig resolves sticking and slipping from the levels given here, so nothing is
// smoothed in this file. Linear in `force`. Limit: no speed dependence, no presliding displacement.

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class CoulombFriction : public Effect {
 public:
  void force(const Motion& /*motion*/, BodyForces& sum) const override {
    const double level = parameter(0);
    sum.sliding_plus += level;
    sum.sliding_minus += level;
    sum.breakaway_plus += level;
    sum.breakaway_minus += level;
  }
};

}  // namespace

FAULTLINE_EFFECT(coulomb_friction, {"coulomb_friction",
                                    "friction",
                                    "-force sgn(v), sticking at rest up to force",
                                    {PortKind::force},
                                    {{"force", "N or N m", 0, 0, 1e6}},
                                    &make_effect<CoulombFriction>});

}  // namespace faultline
