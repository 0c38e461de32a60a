// A gas leak to the air: an orifice of C A = coefficient sqrt(leakage_density/2), coefficient that of the leakage
// effects.
#pragma once

#include "rigs/control_valve/facts.h"

namespace faultline {

class AirLeak {
 public:
  AirLeak(const ValveFacts& facts, const char* port);

  // kg/s at an absolute pressure; `root` as in air_flow.h.
  double operator()(double pressure, double root) const { return port_.empty() ? 0 : flow(pressure, root); }

 private:
  double flow(double pressure, double root) const;

  const EffectChain& port_;
  const double ambient_, area_;
};

}  // namespace faultline
