// Heat loss: heat flow coefficient (T - T_ambient) out of the volume or wall.
//
// coefficient [W/K]: conductance to ambient; adds to HeatPath::loss. Linear.
// Limit: constant conductance, no radiation; ambient temperature is the rig's.

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class HeatLoss : public Effect {
 public:
  void heat(HeatPath& sum) const override { sum.loss += parameter(0); }
};

}  // namespace

FAULTLINE_EFFECT(heat_loss, {"heat_loss",
                             "heat",
                             "coefficient (T - T_ambient)",
                             {PortKind::heat},
                             {{"coefficient", "W/K", 0, 0, 1e6}},
                             &make_effect<HeatLoss>});

}  // namespace faultline
