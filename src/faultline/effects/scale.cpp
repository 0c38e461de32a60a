// Scale: y = factor u.
//
// factor [1]: a gain error of a transducer or amplifier; at a transmission what is handed on times factor (efficiency,
// displacement), at a heat port the heat flux times factor. Linear. It can be undone unless factor is 0; below 1e-6 the
// reading holds nothing worth amplifying and is divided by 1e-6. Limit: no sign reversal, the same gain at all sizes.

#include <algorithm>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

constexpr double kSmallestFactorUndone = 1e-6;

class Scale : public Effect {
 public:
  double signal(double value, double /*time*/) override { return value * parameter(0); }
  double undo_signal(double value, double /*time*/) const override {
    return value / std::max(parameter(0), kSmallestFactorUndone);
  }
  void coupling(Coupling& sum) const override { sum.factor *= parameter(0); }
  void heat(HeatPath& sum) const override { sum.factor *= parameter(0); }
};

}  // namespace

FAULTLINE_EFFECT(scale, {"scale",
                         "gain",
                         "factor u, of a signal, a motion that is handed on or a heat flux",
                         {PortKind::command, PortKind::sensor, PortKind::transmission, PortKind::heat},
                         {{"factor", "1", 1, 0, 10}},
                         &make_effect<Scale>});

}  // namespace faultline
