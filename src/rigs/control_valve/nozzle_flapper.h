// The nozzle-flapper module of the control valve: coil, flapper, nozzle and fixed restrictor (Manninen 2012).
//
//   c_f x_f' = max(0, c_0 - c_1 x_f) p_p A_EA - U f_f ((T_a - T_ref) c_T + 1) - k_f (x_f - x_0)   (1)-(3), (15)
//   m_p = m(C_r A_r, P_S, P_p) - m(f_n nozzle_cd(x_f) pi d_i x_f, P_p, P_a), without the leak      (6)
//
// Capitals P absolute, small p gauge; m: air_flow.h. SI units.
#pragma once

#include <algorithm>

#include "rigs/control_valve/air_flow.h"
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
  const double ambient_, limit_, coil_reference_, restrictor_area_, nozzle_rim_, spring_, per_damping_, rest_,
      coil_factor_, coil_temperature_, pressure_0_, pressure_1_, pressure_area_;
};

inline double NozzleFlapper::speed(double gap, double prestage_gauge, double voltage, double temperature) const {
  const double coil = voltage * coil_factor_ * ((temperature - coil_reference_) * coil_temperature_ + 1);
  const double pressed = std::max(0.0, pressure_0_ - pressure_1_ * gap) * prestage_gauge * pressure_area_;
  return within_stops((pressed - coil - spring_ * (gap - rest_)) * per_damping_, gap, 0, limit_);
}

inline double NozzleFlapper::net_flow(double gap, double prestage, double supply, double root) const {
  const double open = std::max(gap, 0.0);
  const double in = restrictor_port_.opening(restrictor_area_);
  const double out = nozzle_port_.opening(nozzle_rim_ * nozzle_cd_(open) * open);
  return air_flow(in, supply, prestage, root) - air_flow(out, prestage, ambient_, root);
}

}  // namespace faultline
