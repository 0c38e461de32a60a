// Area curve: y = range (|x|/range)^exponent sgn(x): the opening bent, exact at 0 and at full scale.
//
// exponent [1]: above 1 weaker at small openings. range is the port's full scale. Odd and monotone; smooth away from 0,
// where exponents below 1 have infinite slope (finite value). Limit: no dead zone and no shift.

#include <cmath>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class AreaCurve : public Effect {
 public:
  double opening(double value) const override {
    if (parameter(0) == 1) return value;
    return std::copysign(context().range * std::pow(std::fabs(value) * inverse_range_, parameter(0)), value);
  }

 private:
  void parameters_changed() override { inverse_range_ = 1 / context().range; }

  double inverse_range_ = 1;
};

}  // namespace

FAULTLINE_EFFECT(area_curve, {"area_curve",
                              "restriction",
                              "range (|x|/range)^exponent sgn(x)",
                              {PortKind::restriction},
                              {{"exponent", "1", 1, 0.1, 10}},
                              &make_effect<AreaCurve>});

}  // namespace faultline
