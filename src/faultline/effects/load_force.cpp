// External load: F = constant + stiffness x, against positive motion where positive.
//
// constant [N or N m], stiffness [N/m or N m/rad]; both may have either sign. x is the port's position.
// Smooth and linear. Limit: a static load; what moves with the body is added_mass, a one-sided spring is end_stop.

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class LoadForce : public Effect {
 public:
  void force(const Motion& motion, BodyForces& sum) const override {
    sum.applied += parameter(0) + parameter(1) * motion.position;
  }
};

}  // namespace

FAULTLINE_EFFECT(load_force, {"load_force",
                              "load",
                              "-(constant + stiffness x)",
                              {PortKind::force},
                              {{"constant", "N or N m", 0, -1e6, 1e6}, {"stiffness", "N/m or N m/rad", 0, -1e8, 1e8}},
                              &make_effect<LoadForce>});

}  // namespace faultline
