// Differential cylinder, vertical, driven by two pumps of variable speed: pump 2 from side B to side A, pump 1 from
// tank to side A. Source: Kilic, Dolen, Caliskan, Koku, Balkan, Control Engineering Practice 26 (2014) 51-71; numbers
// in config/pump_cylinder.
//
//   q_A = D w_1 + d(D w_2) - C_i (2 P_A - P_B) - 2 C_ea P_A - flow.pump2_a_b - flow.pump2_a_tank - flow.pump1_a_tank
//   q_B = d(D w_2) - C_i (P_A - P_B) + C_eb P_B - flow.pump2_a_b + flow.pump2_b_tank                      (5)-(9)
//   (V_A0 + A_A x)/beta_A P_A' = q_A - A_A v - flow.chamber_a_chamber_b                                   (10), (13)
//   (V_B0 - A_B x)/beta_B P_B' = A_B v - q_B + flow.chamber_a_chamber_b                                   (11), (13)
//   beta(P) = (c_1 + P)(1/c_2 - ln(1 + P/c_1)), changed by compliance.chamber_a and _b                    (12)
//   m v' = A_A P_A - A_B P_B - m g - b v - F(v) - force.piston,  F = (F_c + port's level) tanh(v/v_c)     (14)-(16)
//
// d is source.pump2; source.oil multiplies b and divides C_i, C_ea, C_eb. Friction is smooth, that of effects too: at
// rest the body creeps, slower than v_c, until its forces balance. With line_inertia a side has a pump-side volume V_l
// with the pumps and their leaks, and I q' = P_pump - P - 50 I q; with backlash the rod (0.7 kg) and the plate part:
// states position and velocity are the plate's, as the transducer shows them, and each bears half of the friction. SI
// units throughout; states as in the datasheet, then [P, q of line a], [of line b], [x, v of the rod], [angle of pump
// 2], where they exist. Stiff through friction near standstill. Outside of what a
// run of the datasheet reaches, covers stop the piston at +-50 mm (V_B would reach 0 at 77 mm) and no pressure falls
// below -90 kPa; oil that comes out of solution on the way is not modelled.
#pragma once

#include <limits>

#include "faultline/rig/rig.h"

namespace faultline {

// beta(P) of the datasheet's oil and its derivative; P in Pa gauge, counted as no less than -90 kPa.
class BulkModulus {
 public:
  BulkModulus() = default;
  BulkModulus(double c1, double c2) : c1_(c1), per_c1_(1 / c1), per_c2_(1 / c2) {}
  double value(double pressure) const;
  double slope(double pressure, double value) const;  // `value` there: spares its logarithm

 private:
  double c1_ = 0, per_c1_ = 0, per_c2_ = 0;
};

// The datasheet's parameters that plant and observers share; SI units, `values` in the datasheet's order.
struct CylinderParameters {
  CylinderParameters(const Datasheet& sheet, const std::vector<double>& values);
  double mass, cap_area, rod_area, volume_a, volume_b, displacement, internal, external_a, external_b, viscous, coulomb,
      gravity, line_volume_a, line_volume_b;
  BulkModulus oil;
};

// A costly function of one number, which keeps its values at the last two arguments: while a Jacobian moves one state
// after the other, all others stay.
class Kept {
 public:
  template <class Function>
  double at(double argument, Function&& function) {
    for (int i = 0; i < 2; ++i)
      if (argument == arguments_[i]) return values_[i];
    oldest_ = 1 - oldest_;
    arguments_[oldest_] = argument;
    return values_[oldest_] = function(argument);
  }

 private:
  double arguments_[2] = {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN()};
  double values_[2] = {0, 0};
  int oldest_ = 0;
};

class PumpCylinder : public Rig {
 public:
  PumpCylinder(const Datasheet& sheet, const std::vector<double>& parameters, const EffectSet& effects);

  int states() const override { return count_; }
  void start(const double* channels, double* state) override;
  void start_at(const double* nominal_state, const double* channels, double* state) override;
  std::vector<Integral> integrals() const override;
  void derivative(double time, const double* state, const double* channels, double* rate) override;
  void after_step(double time, double* state, const double* channels) override;
  void outputs(double time, const double* state, double* channels) const override;
  bool stiff() const override { return true; }
  const std::vector<std::pair<int, int>>& jacobian_entries() const override { return entries_; }
  void jacobian(double time, const double* state, const double* channels, double* rate, double* time_rate,
                double* entries) override;

 private:
  // Friction and loads of force.piston on a body that bears `share` of the friction, against positive motion.
  double resistance(double position, double velocity, double load, double share, bool loaded) const;
  double modulus_a(double pressure, Kept& oil) const;
  double modulus_b(double pressure, Kept& oil) const;
  // d(modulus)/d(pressure) with what the port makes of the oil; `modulus`: there.
  double modulus_slope(const EffectChain& port, double pressure, double modulus) const;
  // The Jacobian where effects add states or forces.
  void by_differences(double time, const double* state, const double* channels, const double* rate, double* entries);

  CylinderParameters p_;
  double per_width_, per_mass_;
  int speed1_, speed2_, pressure_sum_, reference_;      // channels that drive
  int out_position_, out_pressure_a_, out_pressure_b_;  // channels that come out
  const EffectChain &force_, &leak_2ab_, &leak_2a_, &leak_2b_, &leak_1a_, &seal_, &compliance_a_, &compliance_b_,
      &line_a_, &line_b_, &plate_, &pump2_, &oil_port_;
  bool has_force_;
  int side_a_ = 0, side_b_ = 0, rod_ = 0, angle_ = 0, count_ = 4;  // where optional states start; 0: there are none
  std::vector<std::pair<int, int>> entries_;
  std::vector<double> probe_, moved_;
  mutable Kept oil_a_, oil_b_, line_oil_a_, line_oil_b_, direction_;
};

}  // namespace faultline
