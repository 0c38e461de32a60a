// Double-rod servo-hydraulic actuator with a proportional valve and a bypass valve that is the internal leak.
// Source: Mahulkar, Adams, Derriso, Control Engineering Practice 19 (2011) 649-657; numbers in config/servo_actuator.
//
//   Q_a = K sqrt2 (e(x_v) root(P - p_a) - e(-x_v) root(p_a)),  e(x) = max(0, x): one edge of restriction.valve    (4)
//   Q_b = K sqrt2 (e(x_v) root(p_b) - e(-x_v) root(P - p_b))
//   Q_i = k_q max(x_leak, 0) root(p_a - p_b) + flow.chamber_a_chamber_b
//   (33)-(35)
//   (V_0 + A x)/beta p_a' = Q_a - A v - Q_i - flow.chamber_a_tank
//   like (2)
//   (V_0 - A x)/beta p_b' = A v - Q_b + Q_i - flow.chamber_b_tank
//   m v' = (p_a - p_b) A - b v - F_friction(v) - F_load - F_stop - force.piston                                     (1)
//   tau_v x_v' = k_v i - x_v;  tau_l x_leak' = u_leak - x_leak;  tau_m q_m' = |Q_bypass| - q_m                      (3)
//
// P is the supply at the valve: the measured one changed by source.supply_pressure. beta = V_0/(2 compliance), changed
// by compliance.chambers. With line_inertia each hose has a flow and a valve-side node of 0.2 V_0; with backlash or
// elasticity at transmission.rod the moving mass and the friction are shared between piston and load. SI units
// throughout; states as in the datasheet, then [p_a, p_b at the valve, q_a, q_b in the hoses], then [x, v of the load],
// where they exist.
#pragma once

#include "faultline/rig/friction.h"
#include "faultline/rig/rig.h"

namespace faultline {

class ServoActuator : public Rig {
 public:
  ServoActuator(const Datasheet& sheet, const std::vector<double>& parameters, const EffectSet& effects);

  int states() const override { return count_; }
  void start(const double* channels, double* state) override;
  void start_at(const double* nominal_state, const double* channels, double* state) override;
  void set_modes(const double* state) override;
  int motion(const double* state) const override;
  void derivative(double time, const double* state, const double* channels, double* rate) override;
  void after_step(double time, double* state, const double* channels) override;
  void outputs(double time, const double* state, double* channels) const override;

 private:
  struct Body {  // forces on one body but for its dry friction, and the levels of that
    double force = 0, mass = 1, sliding_plus = 0, sliding_minus = 0, breakaway_plus = 0, breakaway_minus = 0;
  };
  // `coupling`: what the rod takes from the piston, or the load's force where both are one body, N.
  Body piston(const double* state, double coupling) const;
  Body load(const double* state, double coupling, const double* channels) const;
  double stop_force(double position, double velocity) const;
  double coupling_force(const double* state) const;
  double stribeck(double velocity) const;
  double acceleration(const double* state, double coupling) const;          // of the piston while it slips
  double drooped(double time, const double* state, double measured) const;  // supply pressure

  double area_, mass_, damping_, coulomb_, static_excess_, stribeck_velocity_, chamber_volume_, bulk_modulus_,
      flow_coefficient_, spool_time_, spool_gain_, leak_gain_, leak_time_, meter_time_, stroke_, stop_stiffness_,
      stop_damping_, load_mass_share_, load_friction_share_;
  double root_coefficient_, spool_rate_, leak_rate_, meter_rate_, stribeck_scale_;
  int command_, leak_command_, supply_, load_force_;  // channels that drive
  int out_position_, out_velocity_, out_pressure_, out_a_, out_b_, out_spool_,
      out_leak_flow_;  // channels that come out
  const EffectChain &force_port_, &leak_port_, &leak_a_port_, &leak_b_port_, &compliance_port_, &valve_port_,
      &supply_port_, &line_port_, &rod_port_;
  bool has_line_, has_load_, has_force_, has_droop_, bare_;  // bare: neither force nor load acts on the piston
  int line_ = 0, load_ = 0, count_ = 7;                      // where optional states start
  DryFriction piston_friction_, load_friction_;
};

}  // namespace faultline
