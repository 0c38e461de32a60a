// Droop: y = value - resistance flow: the supply falls with the flow drawn from it.
//
// resistance [Pa s/m^3; Pa s/kg on a rig whose flow is a mass flow]: of the filter and pipe between pump and consumer.
// Linear; flow that comes back lifts the supply, unless the rig cuts it at 0. Limit: static, no accumulator.

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class Droop : public Effect {
 public:
  double boundary(double value, double flow, double /*time*/) const override { return value - parameter(0) * flow; }
};

}  // namespace

FAULTLINE_EFFECT(droop, {"droop",
                         "source",
                         "supply - resistance times flow drawn",
                         {PortKind::source},
                         {{"resistance", "Pa s/m^3 or Pa s/kg", 0, 0, 1e14}},
                         &make_effect<Droop>});

}  // namespace faultline
