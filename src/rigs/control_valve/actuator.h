// The actuator module of the control valve: cylinder, spring-return piston and the linkage that turns its travel into
// an angle (Manninen 2012).
//
//   P_c' = gamma/(V_d + A_c x) (m R T_a - P_c A_c x')                                (7)
//   b_a x' = dz(A_c p_c - k_a (x + x_a0) - T_v phi'(x), -F_c-(x), F_c+(x))           (12)
//   phi(x) = pi/4 + asin((x - L/2)/r),  r = L/sqrt(2)
//
// The piston has no mass: it moves as fast as viscous friction lets its force, once that leaves the Coulomb band.
// Friction that falls with speed has no such answer near standstill: there the piston sticks until its force exceeds
// the breakaway level and slips at the highest speed in balance. Capitals P absolute, small p gauge. SI units.
#pragma once

#include "rigs/control_valve/air_leak.h"
#include "rigs/control_valve/curve.h"

namespace faultline {

class Actuator {
 public:
  explicit Actuator(const ValveFacts& facts);

  double travel(double opening) const;    // m
  double angle(double travel) const;      // rad
  double ratio(double travel) const;      // phi', rad/m
  double ratio_at(double opening) const;  // at the travel of this opening
  double rest_pressure(double travel) const {
    return spring_rate_ * (travel + spring_pretension_) / area_;
  }  // Pa gauge

  // Of the piston, at a load in N: torque times ratio. m/s
  double speed(double travel, double cylinder_gauge, double load) const;
  double cylinder_rate(double travel, double speed, double cylinder, double net_flow, double heat) const;  // Pa/s
  double leak(double cylinder, double root) const { return leak_(cylinder, root); }                        // kg/s

  // Whether it slips, where friction falls with speed: after each step, and never at first.
  bool may_slip() const { return !force_port_.empty(); }
  void follow_slip(double travel, double cylinder_gauge, double load);
  void stick() { slip_ = 0; }

 private:
  double force(double travel, double cylinder_gauge, double load) const;
  double speed_at(double travel, double force) const;
  double slip_speed(double travel, double force, double plus, double minus) const;

  const EffectChain &force_port_, &cylinder_port_;
  const AirLeak leak_;
  const Curve coulomb_plus_, coulomb_minus_;
  const double gamma_, stroke_, crank_, per_crank_, area_, dead_volume_, spring_rate_, spring_pretension_, viscous_,
      plus_factor_, minus_factor_;
  int slip_ = 0;  // direction
};

}  // namespace faultline
