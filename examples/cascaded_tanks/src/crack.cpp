// Crack, an effect that this package brings along: what stands above a crack in the wall of a tank runs out of it,
// q = coefficient sqrt(p - height) where p > height.
//
// p: pressure at the floor (here: level); height: what it is with the level at the crack. Continuous, steep where the
// crack is just covered. Limit: a crack that is short against the tank.
#include <algorithm>
#include <cmath>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class Crack : public Effect {
 public:
  double flow(const LeakPath& path) const override {
    return parameter(0) * std::sqrt(std::max(0.0, path.upstream - parameter(1)));
  }
};

FAULTLINE_EFFECT(crack, {"crack",
                         "leakage",
                         "coefficient sqrt(max(0, upstream - height))",
                         {PortKind::flow},
                         {{"coefficient", "m^3/(s sqrt(Pa))", 0, 0, 1e3}, {"height", "Pa", kNoShape, 0, 1e9}},
                         &make_effect<Crack>});

}  // namespace
}  // namespace faultline
