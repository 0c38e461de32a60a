// Hydraulic motor and load pump on one shaft, the motor fed by a servo-valve.
// Source: Yu, Control Engineering Practice 5 (1997) 1283-1291, numbers in (); values in config/hydraulic_drive.
//
//   T_1 x_1' = K_s v - x_1,  T_2 X_s' = x_1 - X_s                                                                 (11)
//   Q_v = K_0 o(X_s) R(P - sgn(X_s) P_m),  R(d) = d/(d^2 + e^2)^(1/4), e = 10 kPa                                  (12)
//   P_m' = B/V_t (Q_v - C_r S_s - K_l P_m - flow.motor_in_motor_out)                                               (13)
//   I S_s' = k_m C_r eta_m P_m - D S_s - k_p C_r/eta_p P_p - force.shaft                                      (14)-(17)
//
// v is held within 5 V. P is the supply pressure at the valve: the measured one changed by source.supply, which may
// fall with the flow drawn, |Q_v|. k_m, k_p are the factors of transmission.motor and transmission.pump; that of
// transmission.displacement multiplies C_r everywhere. source.oil multiplies D and divides K_l. B is changed by
// compliance.motor_line at the absolute pressure P_m + 2 bar.
//
// States as in the datasheet, then, where they exist:
//   line.motor           V_t half at the valve, half at the motor: pressure at the valve and flow in the column
//   transmission.shaft   I and D half at the motor, half at the pump: speed of the motor end and torque of the
//                        spring. S_s is the pump end, with load and load_force; friction and added mass sit at the
//                        motor end.
// Initial state: at rest for the first inputs; with dry friction the shaft may stand.
#pragma once

#include "faultline/rig/friction.h"
#include "faultline/rig/rig.h"

namespace faultline {

class HydraulicDrive : public Rig {
 public:
  HydraulicDrive(const Datasheet& sheet, const std::vector<double>& parameters, const EffectSet& effects);

  int states() const override { return count_; }
  void start(const double* channels, double* state) override;
  void start_at(const double* nominal_state, const double* channels, double* state) override;
  void set_modes(const double* state) override;
  void derivative(double time, const double* state, const double* channels, double* rate) override;
  void after_step(double time, double* state, const double* channels) override;
  void outputs(double time, const double* state, double* channels) const override;
  double drawn(int channel, double time, const double* state, const double* channels) const override;

 private:
  struct Values {  // of the parameters, after the effects that scale them
    double displacement, motor_torque, pump_torque, friction, leakage;  // C_r, N m/Pa, N m/Pa, D, K_l
  };
  struct Shaft {  // the body at the motor end: torque on it without its dry friction, and the levels of that
    double torque, inertia, sliding_plus, sliding_minus, breakaway_plus, breakaway_minus;
    bool dry() const { return breakaway_plus > 0 || breakaway_minus > 0; }
  };
  const Values& values();
  Values values_now() const;
  double valve_flow(double time, double spool, double pressure, const double* channels) const;
  Coupling spring() const;
  double load_torque(const Values& now, double speed, const double* channels) const;  // at the pump end
  Shaft shaft(const Values& now, const double* state, const double* channels) const;
  double motor_speed(const double* state) const;

  bool changing_;  // whether effects scale parameters, and may grow
  Values values_;
  double valve_rate_1_, valve_rate_2_;  // 1/s
  double valve_time_1_, valve_time_2_, valve_gain_, flow_coefficient_, displacement_, volume_, bulk_modulus_, leakage_,
      motor_efficiency_, pump_efficiency_, inertia_, friction_;
  int command_, supply_, load_, out_pressure_, out_speed_;  // channels
  const EffectChain &force_port_, &leak_port_, &valve_port_, &compliance_port_, &supply_port_, &oil_port_, &motor_port_,
      &pump_port_, &displacement_port_, &shaft_port_, &line_port_;
  int line_ = -1, spring_ = -1, count_ = 4;  // where optional states start
  DryFriction dry_friction_;                 // of the motor end
};

}  // namespace faultline
