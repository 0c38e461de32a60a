// Offset: y = u + value.
//
// value [of what passes]: a transducer's bias, a valve's null shift, a supply that stands too high or low. Linear; can
// be undone exactly. Limit: constant; one that moves is drift.

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class Offset : public Effect {
 public:
  double signal(double value, double /*time*/) override { return value + parameter(0); }
  double undo_signal(double value, double /*time*/) const override { return value - parameter(0); }
  double boundary(double value, double /*flow*/, double /*time*/) const override { return value + parameter(0); }
};

}  // namespace

FAULTLINE_EFFECT(offset, {"offset",
                          "offset",
                          "signal + value",
                          {PortKind::command, PortKind::sensor, PortKind::source},
                          {{"value", "port", 0, -1e9, 1e9}},
                          &make_effect<Offset>});

}  // namespace faultline
