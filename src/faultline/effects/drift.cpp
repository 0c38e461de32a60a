// Drift: y = u + rate (t - t0) for t > t0.
//
// rate [of what passes, per second]. t0 = 0, or the time given by `from`: it then starts at nothing and rises from
// there at the full rate at once, so that `to` has no meaning for it. Linear in `rate`, without memory; can be undone
// exactly. Limit: rises without end; the channel's range cuts it.

#include <algorithm>
#include <cmath>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class Drift : public Effect {
 public:
  double signal(double value, double time) override { return value + drifted(time); }
  double undo_signal(double value, double time) const override { return value - drifted(time); }
  double boundary(double value, double /*flow*/, double time) const override { return value + drifted(time); }

 private:
  double drifted(double time) const { return rate_ * std::max(0.0, time - start_); }

  void parameters_changed() override {
    const bool starts_later = !std::isnan(context().start);
    start_ = starts_later ? context().start : 0;
    // The parameter has already been multiplied by the size, which grows; a drift that starts later does not wait for
    // it.
    rate_ = starts_later && size() > 0 ? parameter(0) / size() : parameter(0);
  }

  double start_ = 0;
  double rate_ = 0;
};

}  // namespace

FAULTLINE_EFFECT(drift, {"drift",
                         "offset",
                         "signal + rate (t - t0)",
                         {PortKind::command, PortKind::sensor, PortKind::source},
                         {{"rate", "port/s", 0, -1e9, 1e9}},
                         &make_effect<Drift>});

}  // namespace faultline
