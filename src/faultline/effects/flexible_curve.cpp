// Flexible curve: y = u + range (sum over i of a_i h_i(u/range)), h_i: hats of a piecewise linear curve with knots at
// -1, -1/4, 1/4, 1.
//
// a_i [1]: what is added at each knot, of full scale; beyond the outer knots the last line goes on. Linear in all
// parameters. No rig is said to have it: the gap diagnoser uses it to find what any static curve at a place could win
// (its closure), so no datasheet lists it.

#include <algorithm>
#include <array>
#include <cmath>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

constexpr std::array<double, 4> kKnots = {-1, -0.25, 0.25, 1};

class FlexibleCurve : public Effect {
 public:
  double signal(double value, double /*time*/) override { return bent(value); }
  double opening(double opening) const override { return bent(opening); }
  // The innermost of the lines on which the value lies; not a number where it lies on none.
  double undo_signal(double value, double /*time*/) const override {
    const double range = context().range;
    for (const std::size_t i : {1u, 0u, 2u}) {
      const double left = bent(range * kKnots[i]), right = bent(range * kKnots[i + 1]);
      const double share = (value - left) / (right - left);
      if (!std::isfinite(share) || (i > 0 && share < 0) || (i < 2 && share > 1)) continue;
      return range * (kKnots[i] + share * (kKnots[i + 1] - kKnots[i]));
    }
    return std::nan("");
  }

 private:
  double bent(double value) const {
    const double x = value / context().range;
    const std::size_t i = x < kKnots[1] ? 0 : x < kKnots[2] ? 1 : 2;
    const double share = (x - kKnots[i]) / (kKnots[i + 1] - kKnots[i]);
    const auto at = [&](std::size_t knot) { return parameter(static_cast<int>(knot)); };
    return value + context().range * (at(i) + share * (at(i + 1) - at(i)));
  }
};

}  // namespace

FAULTLINE_EFFECT(flexible_curve, {"flexible_curve",
                                  "flexible",
                                  "u + range c(u/range), c linear between at_minus_full at -1, at_minus_quarter at "
                                  "-1/4, at_quarter at 1/4, at_full at 1",
                                  {PortKind::command, PortKind::sensor, PortKind::restriction},
                                  {{"at_minus_full", "1", 0, -0.5, 0.5},
                                   {"at_minus_quarter", "1", 0, -0.5, 0.5},
                                   {"at_quarter", "1", 0, -0.5, 0.5},
                                   {"at_full", "1", 0, -0.5, 0.5}},
                                  &make_effect<FlexibleCurve>});

}  // namespace faultline
