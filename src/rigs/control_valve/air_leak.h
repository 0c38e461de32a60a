// A gas leak to the air: an orifice of C A = coefficient sqrt(leakage_density/2), coefficient that of the leakage
// effects.
#pragma once

#include <algorithm>
#include <cmath>

#include "faultline/rig/orifice.h"
#include "rigs/control_valve/air_flow.h"
#include "rigs/control_valve/facts.h"

namespace faultline {

class AirLeak {
 public:
  AirLeak(const ValveFacts& facts, const char* port)
      : port_(facts.effects.at(port)),
        ambient_(facts.constant("atmospheric_pressure")),
        area_(std::sqrt(facts.constant("leakage_density") / 2)) {}

  // kg/s at an absolute pressure; `root` as in air_flow.h.
  double operator()(double pressure, double root) const {
    if (port_.empty()) return 0;
    constexpr double kTransition = 1000;  // Pa, of the leakage effects, so that their coefficient comes out
    const double drop = std::max(pressure - ambient_, 1.0);
    const double coefficient = port_.flow({drop, drop, 0}) / signed_root(drop, kTransition);
    return air_flow(coefficient * area_, pressure, ambient_, root);
  }

 private:
  const EffectChain& port_;
  const double ambient_, area_;
};

}  // namespace faultline
