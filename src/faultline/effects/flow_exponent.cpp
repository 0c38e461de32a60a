// Flow exponent: the flow through a restriction grows with |dp|^exponent in place of the square root,
//   dp -> nominal_drop (|dp|/nominal_drop)^(2 exponent) sgn(dp),  of which the rig takes its root.
//
// exponent [1]: 0.5 changes nothing; towards 1 the restriction is long and its flow laminar (a pipe, a porous plug),
// 0.57 a smooth turbulent pipe. nominal_drop [Pa, or the port's drop_unit], a shape: the pressure difference at which
// the flow is that of the square root; fixed by the datasheet as [value, value], since a coefficient trades with it.
// Odd and continuous; below 0.5 steeper at zero than the root, which the rig's own transition bounds. Only where the
// rig's equations pass the pressure difference through the port's drop().

#include <cmath>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class FlowExponent : public Effect {
 public:
  double drop(double pressure_drop) const override {
    if (parameter(0) == 0.5) return pressure_drop;
    const double share = std::fabs(pressure_drop) / parameter(1);
    return std::copysign(parameter(1) * std::pow(share, 2 * parameter(0)), pressure_drop);
  }
};

}  // namespace

FAULTLINE_EFFECT(flow_exponent, {"flow_exponent",
                                 "restriction",
                                 "flow ~ sgn(dp) |dp|^exponent, as with the square root at nominal_drop",
                                 {PortKind::restriction},
                                 {{"exponent", "1", 0.5, 0.25, 1.5}, {"nominal_drop", "Pa", kNoShape, 1e-6, 1e9}},
                                 &make_effect<FlowExponent>});

}  // namespace faultline
