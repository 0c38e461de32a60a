// Overflow, an effect that this package brings along: what stands above the rim of a tank runs over it,
// q = slope (p - rim) where p > rim.
//
// p: pressure at the floor [Pa]; rim [Pa]: that pressure when the tank is full; infinite: it never is. slope: so steep
// that the level stays within a few per cent of the rim. Continuous, with a kink. Limit: a tank of about 0.01 m^2.
#include <algorithm>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

constexpr double kSlope = 2e-7;  // m^3/(s Pa)

class Overflow : public Effect {
 public:
  double flow(const LeakPath& path) const override { return kSlope * std::max(0.0, path.upstream - parameter(0)); }
};

FAULTLINE_EFFECT(overflow, {"overflow",
                            "leakage",
                            "2e-7 m^3/(s Pa) max(0, upstream - rim)",
                            {PortKind::flow},
                            {{"rim", "Pa", kInfinity, 1, kInfinity}},
                            &make_effect<Overflow>});

}  // namespace
}  // namespace faultline
