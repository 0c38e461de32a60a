// Heat capacity: a wall that must be warmed with the fluid of the volume.
//
// capacity [J/K]: adds to HeatPath::capacity. Linear. Limit: wall and fluid share one temperature, no film between
// them.

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class HeatCapacity : public Effect {
 public:
  void heat(HeatPath& sum) const override { sum.capacity += parameter(0); }
};

}  // namespace

FAULTLINE_EFFECT(heat_capacity, {"heat_capacity",
                                 "heat",
                                 "capacity dT/dt into a wall that is warmed with the fluid",
                                 {PortKind::heat},
                                 {{"capacity", "J/K", 0, 0, 1e8}},
                                 &make_effect<HeatCapacity>});

}  // namespace faultline
