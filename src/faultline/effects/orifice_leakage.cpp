// Orifice leakage: q = coefficient sgn(dp) sqrt|dp|, with a laminar transition: q = coefficient dp/(dp^2 + d^2)^(1/4),
// d = 1000 Pa, or a thousandth of the port's range in its drop_unit.
//
// coefficient [m^3/(s sqrt(Pa))]. Odd in dp and dissipative; smooth, of finite slope coefficient/sqrt(d) at dp = 0.
// Within 0.03 % of the square root above 30 kPa. Linear in `coefficient`.
// Limit: liquids; a gas rig's datasheet says how the coefficient converts to mass flow. No cavitation.

#include <cmath>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class OrificeLeakage : public Effect {
 public:
  double flow(const LeakPath& path) const override {
    const double drop = path.pressure_drop;
    const double laminar = context().transition;
    return parameter(0) * drop / std::sqrt(std::sqrt(drop * drop + laminar * laminar));
  }
};

}  // namespace

FAULTLINE_EFFECT(orifice_leakage, {"orifice_leakage",
                                   "leakage",
                                   "coefficient sgn(dp) sqrt(|dp|)",
                                   {PortKind::flow},
                                   {{"coefficient", "m^3/(s sqrt(Pa))", 0, 0, 1e3}},
                                   &make_effect<OrificeLeakage>});

}  // namespace faultline
