// SUNDIALS (6 or later) on the equations of a rig, for the comparison in numerics_bench.cpp; kAvailable is false in a
// build without it.
#pragma once

#include <memory>
#include <vector>

#include "faultline/numerics/ode_system.h"

namespace faultline {

class SundialsMethod {
 public:
  enum class Kind { bdf, implicit_runge_kutta, explicit_runge_kutta };
  static const bool kAvailable;

  // `scale`: size of each state, which its absolute tolerance is a fraction of. `setting` from 0, the coarsest:
  // tolerances of 10^-(setting + 2) for the backward differentiation formulas (CVODE), 2^setting fixed steps per
  // sample for the Runge-Kutta methods (ARKODE).
  SundialsMethod(Kind kind, OdeSystem& system, const double* inputs, const std::vector<double>& scale, double period,
                 int setting);
  ~SundialsMethod();

  double* state();
  void begin();  // the state was changed, the time goes back to 0
  void sample(double time);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace faultline
