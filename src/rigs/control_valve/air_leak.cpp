#include "rigs/control_valve/air_leak.h"

#include <algorithm>
#include <cmath>

#include "faultline/rig/orifice.h"
#include "rigs/control_valve/air_flow.h"

namespace faultline {

AirLeak::AirLeak(const ValveFacts& facts, const char* port)
    : port_(facts.effects.at(port)),
      ambient_(facts.constant("atmospheric_pressure")),
      area_(std::sqrt(facts.constant("leakage_density") / 2)) {}

double AirLeak::flow(double pressure, double root) const {
  constexpr double kTransition = 1000;  // Pa, of the leakage effects, so that their coefficient comes out
  const double drop = std::max(pressure - ambient_, 1.0);
  const double coefficient = port_.flow({drop, drop, 0}) / signed_root(drop, kTransition);
  return air_flow(coefficient * area_, pressure, ambient_, root);
}

}  // namespace faultline
