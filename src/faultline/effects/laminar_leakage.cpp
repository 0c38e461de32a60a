// Laminar leakage: q = coefficient dp, the flow through a narrow gap.
//
// coefficient [m^3/(s Pa)]: Poiseuille conductance of the gap. Odd, dissipative, smooth and linear.
// Limit: constant gap and viscosity; viscosity_drift changes the nominal conductances, not this one.

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class LaminarLeakage : public Effect {
 public:
  double flow(const LeakPath& path) const override { return parameter(0) * path.pressure_drop; }
};

}  // namespace

FAULTLINE_EFFECT(laminar_leakage, {"laminar_leakage",
                                   "leakage",
                                   "coefficient dp",
                                   {PortKind::flow},
                                   {{"coefficient", "m^3/(s Pa)", 0, 0, 1e3}},
                                   &make_effect<LaminarLeakage>});

}  // namespace faultline
