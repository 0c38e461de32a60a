// Quarter-turn pneumatic control valve in a flow loop: nozzle-flapper, spool valve, spring-return piston, segment valve.
// Source: Manninen, "Fault Simulator and Detection for a Process Control Valve", Aalto University 2012, equations
// (1)-(15); numbers and tables in config/control_valve. dz(F, lo, hi): how far F lies outside the friction band.
//
//   c_f x_f' = max(0, c_0 - c_1 x_f) p_p A_EA - U f_f ((T_a - T_ref) c_T + 1) - k_f (x_f - x_0)             (1)-(3), (15)
//   P_p' = gamma/(V_p + A_p X) ((m_r - m_n - m_leak) R T_a - P_p A_p X')                                         (6), (7)
//   b_s X' = dz(A_p p_p - A_s p_S - k_ss (X + x_spre) - k_d X, -F_cs, F_cs)                                      (8)-(10)
//   P_c' = gamma/(V_d + A_c x) ((m_c - m_leak) R T_a - P_c A_c x')                                                    (7)
//   b_a x' = dz(A_c p_c - k_a (x + x_a0) - T_v phi'(x), -F_c-(x), F_c+(x))                                           (12)
//   phi_w T_v' = w T_c - |w| T_v,  w = phi'(x) x',  T_c = f_mu mu(h) F_seal l                          in place of (11)
//   Q = 0.865 C_v c sqrt(dp/1e5)/3600,  dp = dp_0 DP_f/(DP_f + (1 - DP_f) c^2),  c = a h + (1 - a) h^3         (13), (14)
//
// m_r, m_n, m_c: air_flow.h; capitals P absolute, small p gauge. No body has mass: each moves as fast as viscous
// friction lets its force, once that leaves the Coulomb band. Friction that falls with speed has no such answer near
// standstill: there the piston sticks until its force exceeds the breakaway level and slips at the highest speed in
// balance.
//
// States: the spool's is X over its stroke, the piston's the opening at which a tight joint holds the shaft, phi(x)/(pi/2).
// With effects at transmission.linkage two states follow: where the piston stands in the play [m], and the twist of the
// joint [rad]. Inside the play the seal holds the valve and T_v is 0. Damping of the joint works where it is slower than
// the integration step, else the twist is compliance T_v. Gas leaks: C A = coefficient sqrt(leakage_density/2). SI units.
#pragma once

#include "faultline/rig/rig.h"
#include "rigs/control_valve/curve.h"

namespace faultline {

class ControlValve : public Rig {
 public:
  ControlValve(const Datasheet& sheet, const std::vector<double>& parameters, const EffectSet& effects);

  int states() const override { return linked_ ? 8 : 6; }
  // The spool in the middle in balance, the piston where the flow, or else the valve, is at its set point.
  void start(const double* channels, double* state) override;
  void start_at(const double* nominal_state, const double* channels, double* state) override;
  void set_modes(const double* state) override;
  void derivative(double time, const double* state, const double* channels, double* rate) override;
  void after_step(double time, double* state, const double* channels) override;
  void outputs(double time, const double* state, double* channels) const override;

 private:
  struct MassFlows {    // kg/s
    double supply = 0;  // Pa gauge, at the device
    double prestage = 0, prestage_leak = 0, cylinder = 0, cylinder_leak = 0;
  };
  struct Band {  // a dry friction's levels in both directions, N, and viscous friction, N s/m
    double plus = 0, minus = 0, viscous = 1;
  };
  struct Shaft {
    double piston = 0;           // x, m
    double ratio = 0;            // phi' of the joint's driven side, rad/m
    double opening = 0;          // h
    double torque = 0;           // T_v
    double plus = 0, minus = 0;  // T_c in both directions, N m
  };

  MassFlows mass_flows(double time, const double* state, const double* channels) const;
  double spool_flow(double spool, double cylinder, double supply, double root) const;
  double leak(const EffectChain& port, double pressure, double root) const;
  Shaft shaft(const double* state) const;
  double travel(double opening) const;
  double angle(double travel) const;
  double ratio(double travel) const;  // phi'
  double twist(const double* state, double torque) const;
  double piston_force(const double* state, const Shaft& shaft) const;
  double piston_speed(const double* state, const Shaft& shaft) const;
  double slip_speed(double position, double force, const Band& band) const;
  double spool_speed(const double* state, double supply) const;
  double pressure_drop(double opening) const;
  double flow(double opening) const;
  double relative_opening(double opening) const;  // c
  void follow_play(double* state);

  const EffectChain &spool_port_, &actuator_port_, &seal_port_, &prestage_leak_, &cylinder_leak_, &restrictor_port_,
      &nozzle_port_, &spool_ports_, &process_port_, &cylinder_port_, &linkage_port_, &supply_port_;
  const bool linked_;
  Curve nozzle_cd_, fill_low_, fill_high_, exhaust_0_, exhaust_2_, exhaust_4_, coulomb_plus_, coulomb_minus_, seal_mu_;

  double gamma_, gas_constant_, ambient_, stroke_, seal_lever_, flapper_limit_, coil_reference_,
      leak_area_;  // constants
  double nozzle_diameter_, restrictor_area_, nozzle_factor_, flapper_spring_, flapper_damping_, flapper_rest_,
      coil_factor_, coil_temperature_, pressure_0_, pressure_1_, pressure_area_, prestage_volume_, prestage_area_,
      supply_area_, spool_stroke_, spool_spring_, spool_pretension_, diaphragm_, spool_viscous_, spool_coulomb_,
      port_area_, fill_factor_, exhaust_factor_, cylinder_area_, dead_volume_, spring_rate_, spring_pretension_,
      actuator_viscous_, plus_factor_, minus_factor_, seal_torque_, windup_, capacity_, linear_share_, pump_pressure_,
      open_ratio_;
  double crank_;                                                         // r of the linkage, m
  int voltage_, supply_, temperature_, flow_setpoint_, valve_setpoint_;  // channels that drive
  int out_flapper_, out_prestage_, out_spool_, out_cylinder_, out_torque_, out_position_, out_flow_;
  int out_prestage_flow_, out_cylinder_flow_;  // -1 where they are not recorded

  int slip_ = 0;     // direction in which the piston slips, where friction falls with speed
  int contact_ = 0;  // flank of the play: 1 pushes the valve open, -1 closed, 0 is none
  MassFlows last_;   // for what is recorded of them
};

}  // namespace faultline
