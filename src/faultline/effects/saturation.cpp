// Saturation: y = min(max(u, -limit), limit).
//
// limit [of what passes]; infinite: none. Continuous, with kinks; reaches no effect as 1/size. Without memory; what it
// shows at the limit is a bound, from which nothing is undone.
// Limit: symmetric about zero.

#include <algorithm>
#include <cmath>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class Saturation : public Effect {
 public:
  double signal(double value, double /*time*/) override {
    return std::min(std::max(value, -parameter(0)), parameter(0));
  }
  double undo_signal(double value, double /*time*/) const override {
    return std::fabs(value) < parameter(0) ? value : std::nan("");
  }
};

}  // namespace

FAULTLINE_EFFECT(saturation, {"saturation",
                              "limit",
                              "u where |u| < limit, else limit sgn(u)",
                              {PortKind::command, PortKind::sensor},
                              {{"limit", "port", kInfinity, 1e-12, kInfinity}},
                              &make_effect<Saturation>});

}  // namespace faultline
