// Stribeck friction: F = static_excess exp(-|v/velocity|^exponent) sgn(v); at rest anything up to static_excess.
//
// static_excess [N or N m]: how far the level at rest lies above the level at speed.
// velocity [m/s or rad/s], a shape: where the excess has fallen to 1/e.
// exponent [1], a shape: 2 where it falls as a normal density, 1 where it falls exponentially; about 1 is near to
// 1/(1 + (v/velocity)^2) as well.
// Smooth in v on either side of standstill, set-valued at v = 0 (the rig sticks and slips). Linear in static_excess.
// Limit: static map without frictional memory; rising and falling speed give the same force.

#include <cmath>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class StribeckFriction : public Effect {
 public:
  void force(const Motion& motion, BodyForces& sum) const override {
    const double ratio = std::abs(motion.velocity) * inverse_velocity_, exponent = parameter(2);
    const double excess = parameter(0) * std::exp(exponent == 2 ? -ratio * ratio : -std::pow(ratio, exponent));
    sum.sliding_plus += excess;
    sum.sliding_minus += excess;
    sum.breakaway_plus += parameter(0);
    sum.breakaway_minus += parameter(0);
  }

 private:
  void parameters_changed() override { inverse_velocity_ = 1 / parameter(1); }

  double inverse_velocity_ = 0;
};

}  // namespace

FAULTLINE_EFFECT(stribeck_friction, {"stribeck_friction",
                                     "friction",
                                     "-static_excess exp(-|v/velocity|^exponent) sgn(v), sticking at rest",
                                     {PortKind::force},
                                     {{"static_excess", "N or N m", 0, 0, 1e6},
                                      {"velocity", "m/s or rad/s", kNoShape, 1e-6, 1e3},
                                      {"exponent", "1", kNoShape, 0.7, 2, 2}},
                                     &make_effect<StribeckFriction>});

}  // namespace faultline
