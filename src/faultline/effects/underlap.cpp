// Underlap: each metering edge opens width/2 early, edge(x) = x + width/2, so that both are open within +-width/2.
//
// width [of what passes]: total width in which both edges are open. What passes as one number is what the edges differ
// by: y = 2 x within +-width/2, x + sgn(x) width/2 outside - twice the gain about zero. A rig whose valve has edges of
// their own (edge() of its port) has the null leakage and the lower pressure gain too. Continuous, odd, with kinks;
// linear in `width` where it responds; undone exactly. The contrary of deadband.
// Limit: both edges alike; a shifted zone is an offset before it.

#include <cmath>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class Underlap : public Effect {
 public:
  double signal(double value, double /*time*/) override { return opening(value); }
  double undo_signal(double value, double /*time*/) const override {
    return std::fabs(value) < parameter(0) ? value / 2 : value - std::copysign(half(), value);
  }
  double opening(double value) const override {
    return std::fabs(value) < half() ? 2 * value : value + std::copysign(half(), value);
  }
  double edge(double value) const override { return value + half(); }

 private:
  double half() const { return 0.5 * parameter(0); }
};

}  // namespace

FAULTLINE_EFFECT(underlap, {"underlap",
                            "deadzone",
                            "2 u where |u| < width/2, else u + sgn(u) width/2: both edges open about zero",
                            {PortKind::command, PortKind::restriction},
                            {{"width", "port", 0, 0, 1e9}},
                            &make_effect<Underlap>});

}  // namespace faultline
