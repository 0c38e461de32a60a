// Line inertia: inertance dq/dt = dp, the inertia of the fluid column between two places.
//
// inertance [Pa s^2/m^3] = density length / area. Adds to Line::inertance; the rig gives the pipe a flow state where it
// is above 0. Linear; as it goes to 0 the pipe's own motion becomes ever faster, and the rig treats it as stiff or
// leaves it out. Limit: one lumped column, no travelling waves and no frequency-dependent friction.

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class LineInertia : public Effect {
 public:
  void line(Line& sum) const override { sum.inertance += parameter(0); }
};

}  // namespace

FAULTLINE_EFFECT(line_inertia, {"line_inertia",
                                "line",
                                "inertance dq/dt = dp of the fluid column",
                                {PortKind::line},
                                {{"inertance", "Pa s^2/m^3", 0, 0, 1e12}},
                                &make_effect<LineInertia>});

}  // namespace faultline
