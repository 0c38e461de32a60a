// Load-dependent friction: the Coulomb level grows by coefficient |load|, as pressure presses a seal onto its seat.
//
// coefficient [N/Pa, N m/Pa or N/N]: by what the port's load is (the datasheet says: a pressure or a force).
// Moving and at rest alike. Linear in `coefficient`; the magnitude of the load keeps friction dissipative when the load
// changes sign. Limit: no saturation at high load; like Coulomb friction where the load hardly varies.

#include <cmath>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class LoadDependentFriction : public Effect {
 public:
  void force(const Motion& motion, BodyForces& sum) const override {
    const double level = parameter(0) * std::fabs(motion.load);
    sum.sliding_plus += level;
    sum.sliding_minus += level;
    sum.breakaway_plus += level;
    sum.breakaway_minus += level;
  }
};

}  // namespace

FAULTLINE_EFFECT(load_dependent_friction, {"load_dependent_friction",
                                           "friction",
                                           "-coefficient |load| sgn(v)",
                                           {PortKind::force},
                                           {{"coefficient", "N or N m per unit of load", 0, 0, 1e3}},
                                           &make_effect<LoadDependentFriction>});

}  // namespace faultline
