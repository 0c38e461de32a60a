// Entrained air: 1/beta_total = 1/beta + fraction (p0/p)^(1/n)/(n p), free gas that is compressed with the liquid.
//
// fraction [1]: volume of gas per volume of fluid at p0 = 101325 Pa absolute. exponent n [1], a shape: 1 where bubbles
// keep the liquid's temperature (slow cycles, small bubbles), 1.4 for air where none of the heat of compression
// leaves them, between the two on a rig. At pressure p the gas takes fraction (p0/p)^(1/n), and its own modulus is
// n p. p is absolute and counted as no less than 20 kPa, where vapour takes over. Smooth above that floor; the
// softness is linear in `fraction`. Limit: nothing dissolves; the exponent does not change with the cycle; the liquid's
// own share is taken as 1.

#include <algorithm>
#include <cmath>

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
    const double compressed = kAmbientPressure / pressure, n = parameter(1);
    return 1 / (1 / modulus + parameter(0) * (n == 1 ? compressed : std::pow(compressed, 1 / n)) / (n * pressure));
  }
};

}  // namespace

FAULTLINE_EFFECT(entrained_air, {"entrained_air",
                                 "compliance",
                                 "1/beta + fraction (p0/p)^(1/exponent)/(exponent p), free gas at p0 = 101325 Pa",
                                 {PortKind::compliance},
                                 {{"fraction", "1", 0, 0, 1}, {"exponent", "1", kNoShape, 1, 1.4, 1}},
                                 &make_effect<EntrainedAir>});

}  // namespace faultline
