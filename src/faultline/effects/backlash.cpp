// Backlash: total play `gap` between the two sides of a transmission; the driven side moves only when the gap is used
// up.
//
// gap [m or rad, by the port]: adds to Coupling::gap; the rig's two bodies do the contact. Linear in `gap`.
// Limit: the contact's stiffness and damping are the rig's (or elasticity's at the same port).

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class Backlash : public Effect {
 public:
  void coupling(Coupling& sum) const override { sum.gap += parameter(0); }
};

}  // namespace

FAULTLINE_EFFECT(backlash, {"backlash",
                            "play",
                            "contact of the two sides only where they are more than gap/2 apart",
                            {PortKind::transmission},
                            {{"gap", "m or rad", 0, 0, 10}},
                            &make_effect<Backlash>});

}  // namespace faultline
