// Quantisation: y = step round(u/step), halves away from zero.
//
// step [of what passes]. Piecewise constant in u; the error is at most step/2 and goes to 0 with step.
// Limit: an ideal converter, no missing codes and no hysteresis of its own.

#include <cmath>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

constexpr double kUniform = 0.28867513459481287;   // sqrt(1/12), standard deviation over one
constexpr double kMostSteps = 4503599627370496.0;  // 2^52: beyond, every double is a multiple of the step already

class Quantisation : public Effect {
 public:
  double signal(double value, double /*time*/) override {
    const double step = parameter(0);
    if (std::fabs(value) >= kMostSteps * step) return value;
    return step * std::round(value / step);
  }
  Shown undo(const Course& out, double later, double /*time*/, double /*own*/) const override {
    Shown in = out(later);
    in.std = std::hypot(in.std, parameter(0) * kUniform);
    return in;
  }
};

}  // namespace

FAULTLINE_EFFECT(quantisation, {"quantisation",
                                "resolution",
                                "step round(u/step)",
                                {PortKind::command, PortKind::sensor},
                                {{"step", "port", 0, 0, 1e9}},
                                &make_effect<Quantisation>});

}  // namespace faultline
