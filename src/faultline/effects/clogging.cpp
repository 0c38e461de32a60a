// Clogging: area or coefficient times (1 - fraction).
//
// fraction [1]: share of the area that is lost; 1 is shut, a small negative one is an area above nominal (wear, or a
// worn in edge). Linear. Limit: the same share at every opening; a change of shape is area_curve.

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class Clogging : public Effect {
 public:
  double opening(double value) const override { return value * (1 - parameter(0)); }
};

}  // namespace

FAULTLINE_EFFECT(clogging, {"clogging",
                            "restriction",
                            "opening (1 - fraction), of an area or a coefficient",
                            {PortKind::restriction},
                            {{"fraction", "1", 0, -0.15, 1}},
                            &make_effect<Clogging>});

}  // namespace faultline
