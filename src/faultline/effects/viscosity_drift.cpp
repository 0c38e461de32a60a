// Viscosity drift: viscosity times factor, as the fluid cools (above 1) or warms (below 1).
//
// factor [1]: hands the ratio to the rig, which multiplies viscous friction by it and divides laminar leakage by it
// (its datasheet says what else it moves). Linear in `factor`. Limit: one temperature for the whole rig; density, bulk
// modulus and turbulent flow stay as they are.

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class ViscosityDrift : public Effect {
 public:
  void viscosity(Viscosity& sum) const override { sum.factor *= parameter(0); }
};

}  // namespace

FAULTLINE_EFFECT(viscosity_drift, {"viscosity_drift",
                                   "temperature",
                                   "viscous friction times factor, laminar leakage divided by it",
                                   {PortKind::source},
                                   {{"factor", "1", 1, 0.05, 20}},
                                   &make_effect<ViscosityDrift>});

}  // namespace faultline
