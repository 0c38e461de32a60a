// Added mass: inertia that moves with the body, m_total = m + mass.
//
// mass [kg, or kg m^2 on a rotating body]. Linear. Limit: rigidly attached, no weight of its own (that is load_force).

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class AddedMass : public Effect {
 public:
  void force(const Motion& /*motion*/, BodyForces& sum) const override { sum.mass += parameter(0); }
};

}  // namespace

FAULTLINE_EFFECT(added_mass, {"added_mass",
                              "load",
                              "moving inertia + mass",
                              {PortKind::force},
                              {{"mass", "kg or kg m^2", 0, 0, 1e6}},
                              &make_effect<AddedMass>});

}  // namespace faultline
