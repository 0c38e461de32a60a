// The spool valve module of the control valve: prestage chamber, diaphragms, spool and its ports, and the supply in
// front of them (Manninen 2012).
//
//   P_p' = gamma/(V_p + A_p X) (m R T_a - P_p A_p X')                                       (7)
//   b_s X' = dz(A_p p_p - A_s p_S - k_ss (X + x_spre) - k_d X, -F_cs, F_cs)                 (8)-(10)
//   s > 0.5: m_c = m(f_fi fill_cd(s, P_c/P_S) A_v (s - 0.5)/0.5, P_S, P_c)
//   s <= 0.5: m_c = -m(f_ex exhaust_cd(s, p_c) A_v (0.5 - s)/0.5, P_c, P_a)
//
// s = X/L_s. Capitals P absolute, small p gauge; m: air_flow.h. SI units.
#pragma once

#include "rigs/control_valve/curve.h"
#include "rigs/control_valve/facts.h"

namespace faultline {

class SpoolValve {
 public:
  explicit SpoolValve(const ValveFacts& facts);

  double stroke() const { return stroke_; }   // m
  double balance(double supply_gauge) const;  // Pa gauge, of the prestage, that holds the spool in the middle
  double speed(double share, double prestage_gauge, double supply_gauge) const;  // m/s
  double flow(double share, double cylinder, double supply, double root) const;  // kg/s, into the cylinder
  // Pa gauge at the device where the measured one is `measured`: with an effect at source.supply the filling flow
  // lowers the pressure that drives it.
  double supply(double time, double share, double cylinder, double measured, double root) const;
  double prestage_rate(double share, double speed, double prestage, double net_flow, double heat) const;  // Pa/s

 private:
  const EffectChain &force_port_, &ports_, &supply_port_;
  const Curve fill_low_, fill_high_, exhaust_0_, exhaust_2_, exhaust_4_;
  const double gamma_, ambient_, prestage_volume_, prestage_area_, supply_area_, stroke_, spring_, pretension_,
      diaphragm_, viscous_, coulomb_, port_area_, fill_factor_, exhaust_factor_;
};

}  // namespace faultline
