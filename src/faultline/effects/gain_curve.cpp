// Gain curve: y = u (1 + curvature (|u|/range - 1)): exact at 0 and at full scale, bent between.
//
// curvature [1]: positive is weaker at small signals. Monotone for |curvature| < 1. range is the port's full scale.
// Smooth but for the second derivative at 0; linear in `curvature`; can be undone up to where a negative curvature
// turns the parabola. Limit: odd; beyond range it keeps its parabola.

#include <cmath>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class GainCurve : public Effect {
 public:
  double signal(double value, double /*time*/) override {
    return value * (1 + parameter(0) * (std::fabs(value) * inverse_range_ - 1));
  }
  // The root of curvature/range u^2 + (1 - curvature) u = |y| that is 0 with it; none beyond the curve's turn.
  double undo_signal(double value, double /*time*/) const override {
    const double slope = 1 - parameter(0);
    const double square = slope * slope + 4 * parameter(0) * inverse_range_ * std::fabs(value);
    return square < 0 ? std::nan("") : 2 * value / (slope + std::sqrt(square));
  }

 private:
  void parameters_changed() override { inverse_range_ = 1 / context().range; }

  double inverse_range_ = 1;
};

}  // namespace

FAULTLINE_EFFECT(gain_curve, {"gain_curve",
                              "gain",
                              "u (1 + curvature (|u|/range - 1))",
                              {PortKind::command, PortKind::sensor},
                              {{"curvature", "1", 0, -0.95, 0.95}},
                              &make_effect<GainCurve>});

}  // namespace faultline
