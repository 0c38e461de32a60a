// Entrained air: 1/beta_total = 1/beta + fraction p0/p^2, free gas that is compressed isothermally with the liquid.
//
// fraction [1]: volume of gas per volume of fluid at p0 = 101325 Pa absolute. At pressure p it takes fraction p0/p, and
// its own modulus is p: softness fraction p0/p^2. p is absolute and counted as no less than 20 kPa, where vapour takes
// over. Smooth above that floor; the softness is linear in `fraction`. Limit: nothing dissolves; isothermal, so up
// to 1.4 times too soft for fast cycles; the liquid's own share is taken as 1.

#include <algorithm>

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

constexpr double kAmbientPressure = 101325;  // Pa
constexpr double kLowestPressure = 2e4;      // Pa

class EntrainedAir : public Effect {
 public:
  double bulk_modulus(double modulus, double absolute_pressure) const override {
    if (parameter(0) <= 0) return modulus;
    const double pressure = std::max(absolute_pressure, kLowestPressure);
    return 1 / (1 / modulus + parameter(0) * kAmbientPressure / (pressure * pressure));
  }
};

}  // namespace

FAULTLINE_EFFECT(entrained_air, {"entrained_air",
                                 "compliance",
                                 "1/beta + fraction p0/p^2, free gas at p0 = 101325 Pa",
                                 {PortKind::compliance},
                                 {{"fraction", "1", 0, 0, 1}},
                                 &make_effect<EntrainedAir>});

}  // namespace faultline
