// The nozzle-flapper module of the control valve: coil, flapper, nozzle and fixed restrictor (Manninen 2012).
//
//   c_f x_f' = max(0, c_0 - c_1 x_f) p_p A_EA - U f_f ((T_a - T_ref) c_T + 1) - k_f (x_f - x_0)   (1)-(3), (15)
//   m_p = m(C_r A_r, P_S, P_p) - m(f_n nozzle_cd(x_f) pi d_i x_f, P_p, P_a), without the leak      (6)
//
// Capitals P absolute, small p gauge; m: air_flow.h. SI units.
#pragma once

#include "rigs/control_valve/air_leak.h"
#include "rigs/control_valve/curve.h"

namespace faultline {

class NozzleFlapper {
 public:
  explicit NozzleFlapper(const ValveFacts& facts);

  double rest() const { return rest_; }                                                       // m, of the flapper
  double limit() const { return limit_; }                                                     // m
  double speed(double gap, double prestage_gauge, double voltage, double temperature) const;  // m/s
  double net_flow(double gap, double prestage, double supply, double root) const;             // kg/s
  double leak(double prestage, double root) const { return leak_(prestage, root); }           // kg/s

 private:
  const EffectChain &restrictor_port_, &nozzle_port_;
  const AirLeak leak_;
  const Curve nozzle_cd_;
  const double ambient_, limit_, coil_reference_, nozzle_diameter_, restrictor_area_, nozzle_factor_, spring_, damping_,
      rest_, coil_factor_, coil_temperature_, pressure_0_, pressure_1_, pressure_area_;
};

}  // namespace faultline
