// Direction-dependent friction: the Coulomb level is higher by difference/2 for v > 0 and lower by difference/2 for v <
// 0.
//
// difference [N or N m]: level to + minus level to -; either sign. Moving and at rest alike.
// Linear in `difference`. Limit: it only shifts levels that are there: alone, or larger than twice the level it shifts,
// it would drive the body one way; the rig cuts a level that would be negative at 0. Close to a constant load while the
// direction does not change.

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class AsymmetricFriction : public Effect {
 public:
  void force(const Motion& /*motion*/, BodyForces& sum) const override {
    const double half = 0.5 * parameter(0);
    sum.sliding_plus += half;
    sum.sliding_minus -= half;
    sum.breakaway_plus += half;
    sum.breakaway_minus -= half;
  }
};

}  // namespace

FAULTLINE_EFFECT(asymmetric_friction, {"asymmetric_friction",
                                       "friction",
                                       "Coulomb level +difference/2 for v>0, -difference/2 for v<0",
                                       {PortKind::force},
                                       {{"difference", "N or N m", 0, -1e6, 1e6}},
                                       &make_effect<AsymmetricFriction>});

}  // namespace faultline
