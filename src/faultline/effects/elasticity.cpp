// Elasticity: a spring and a damper between the two sides, force = relative motion / compliance + damping relative
// speed.
//
// compliance [m/N or rad/(N m)]: adds to Coupling::compliance; 0 is rigid.
// damping [N s/m or N m s/rad], a shape: parallel to the spring, counted only where there is compliance.
// As compliance goes to 0 the relative motion does too, whatever the damping. Limit: linear spring; of several at one
// port the compliances add, as in series, and so do the dampings.

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class Elasticity : public Effect {
 public:
  void coupling(Coupling& sum) const override {
    if (parameter(0) <= 0) return;
    sum.compliance += parameter(0);
    sum.damping += parameter(1);
  }
};

}  // namespace

FAULTLINE_EFFECT(elasticity,
                 {"elasticity",
                  "play",
                  "(x_1 - x_2)/compliance + damping (v_1 - v_2), between the two sides",
                  {PortKind::transmission},
                  {{"compliance", "m/N or rad/(N m)", 0, 0, 10}, {"damping", "N s/m or N m s/rad", kNoShape, 0, 1e7}},
                  &make_effect<Elasticity>});

}  // namespace faultline
