// Compliance factor: bulk modulus (stiffness of the volume) times factor.
//
// factor [1]: below 1 softer: a hose that has aged, extra dead volume. Linear in beta, the same at every pressure.
// Limit: it cannot be told from a wrong volume; pressure dependence is entrained_air.

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class ComplianceFactor : public Effect {
 public:
  double bulk_modulus(double modulus, double /*absolute_pressure*/) const override { return modulus * parameter(0); }
};

}  // namespace

FAULTLINE_EFFECT(compliance_factor, {"compliance_factor",
                                     "compliance",
                                     "bulk modulus times factor",
                                     {PortKind::compliance},
                                     {{"factor", "1", 1, 0.01, 100}},
                                     &make_effect<ComplianceFactor>});

}  // namespace faultline
