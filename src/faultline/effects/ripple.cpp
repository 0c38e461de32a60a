// Ripple: y = value + amplitude sin(2 pi frequency t + phase).
//
// amplitude [of the source]; frequency [Hz] and phase [rad], shapes. Smooth, linear in `amplitude`; t is the
// recording's time. Limit: one sinusoid; a pump's ripple that follows its shaft is displacement_ripple.

#include <cmath>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

constexpr double kTwoPi = 6.283185307179586, kPi = 3.141592653589793;

class Ripple : public Effect {
 public:
  double boundary(double value, double /*flow*/, double time) const override {
    return value + parameter(0) * std::sin(angular_frequency_ * time + parameter(2));
  }

 private:
  void parameters_changed() override { angular_frequency_ = kTwoPi * parameter(1); }

  double angular_frequency_ = 0;  // rad/s
};

}  // namespace

FAULTLINE_EFFECT(ripple, {"ripple",
                          "source",
                          "value + amplitude sin(2 pi frequency t + phase)",
                          {PortKind::source},
                          {{"amplitude", "port", 0, 0, 1e9},
                           {"frequency", "Hz", kNoShape, 0, 1e5},
                           {"phase", "rad", kNoShape, -kPi, kPi, 0}},
                          &make_effect<Ripple>});

}  // namespace faultline
