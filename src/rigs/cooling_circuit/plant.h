// Water cooling circuit of a rocket-engine test bench: tank, bench valve, manifold and five parallel branches.
// Source: fault diagnosis benchmark on the MASCOTTE bench (ATAC campaign 2014); numbers in config/cooling_circuit.
//
//   root(x) = x/(x^2 + d^2)^(1/4), tube(x) = c^(8/7) x/(x^2 + d^2)^(3/14), d = 100 Pa: q^0.875 = c sqrt(x), the tube's
//   Blasius loss
//   tau_v z' = clamp(u) - z,  tau_s s' = max(h, 0) - s,  q_v = k_v z root(P_s - P_m),  V_m/a^2 P_m' = q_v - sum q_f
//   each branch: q_f = k_f root(P_m - P_1),  q_12 = tube(P_1 - P_2),  q_2 = k_d root(P_2 - P_d) + leak after the meter
//     b P_1' = q_f - q_12 - leak,  b P_2' = q_12 - q_2 - leak                                         (1), (4), (8)
//     rho b a^2 cv T_1' = cv max(q_f, 0) (T_w - T_1)
//     (rho b a^2 cv + C_w) T_2' = cv max(q_12, 0) (T_1 - T_2) + Q_n s - K (T_2 - T_a)                 (1), (3)
//
// Mass flows in kg/s, leaks are rho times the volume flow of the effect, pressures absolute in Pa, temperatures in K.
// Stiff: cavities settle within microseconds. States as in the datasheet, then, where pipes have inertia, the
// pressure x over what they feed: with line.feed over the valve, (inertance/rho) (k_v z root(x))' = P - P_m - x; with
// line.{b}_orifice over the tube, (inertance/rho) tube(x)' = P_1 - P_2 - x. Viscosity scales c by
// (mu/mu_nominal)^-0.125, mu falling exponentially with the branch's mean temperature. A restriction's effects at the
// tube act on c sqrt(x).
#pragma once

#include "faultline/rig/rig.h"

namespace faultline {

class CoolingCircuit : public Rig {
 public:
  CoolingCircuit(const Datasheet& sheet, const std::vector<double>& parameters, const EffectSet& effects);

  int states() const override { return count_; }
  // At rest for these commands and this supply; with the valve shut all pressures are P_d. Water that stands is at T_w.
  // InputError where there is no such state.
  void start(const double* channels, double* state) override;
  void start_as_shown(const std::function<double(int channel)>& shown, double* state) override;
  void start_at(const double* nominal_state, const double* channels, double* state) override;
  void derivative(double time, const double* state, const double* channels, double* rate) override;
  void outputs(double time, const double* state, double* channels) const override;
  bool stiff() const override { return true; }
  const std::vector<std::pair<int, int>>& jacobian_entries() const override {
    return at_rest_ ? rest_entries_ : entries_;
  }
  void jacobian(double time, const double* state, const double* channels, double* rate, double* time_rate,
                double* entries) override;

 private:
  struct Flow {  // and how it changes with what drives it
    double value = 0, slope = 0;
  };
  struct Branch {
    double compliance, tube, feed, drain, heat_flux;  // b, c^(8/7), k_f, k_d, Q_n
    double reference_flow;                            // q_r of the tube's curve, kg/s
    const EffectChain *leak_inlet, *leak_outlet, *leak_drain, *feed_port, *tube_port, *drain_port, *back_pressure,
        *line_port, *wall;
    int line = -1;  // state of the pressure over the tube, if its line has inertia
    int inlet, outlet, meter, inlet_temperature, outlet_temperature;  // channels
    int state;                                                        // first of P_1, P_2, T_1, T_2
    bool stands = false;                                              // at the start
  };
  struct Header {                       // what the branches share
    double compliance = 0;              // V_m/a^2, kg/Pa
    double water = 0, water_rate = 0;   // T_w, K and K/s
    double drawn = 0, drawn_slope = 0;  // sum of q_f, and its derivative by P_m
  };
  // Rates, and the Jacobian into `sink`.
  template <class Sink>
  void evaluate(double time, const double* state, const double* channels, double* rate, Sink& sink) const;
  template <class Sink>
  void evaluate(const Branch& branch, double time, const double* state, Header& header, double* rate, Sink& sink) const;

  // From the initial state, wherever that leads; returns the states that do not settle.
  std::vector<int> come_to_rest(const double* channels, double* state);
  Flow tube(const Branch& branch, double drop, double viscosity) const;
  Flow leak(const EffectChain& chain, double pressure) const;
  Flow drain(const Branch& branch, double pressure, double time) const;
  double viscosity(double temperature) const;  // what multiplies c^(8/7) at a branch's mean temperature
  double valve(double opening) const;
  // Flow through valve and feed line without inertia: what comes out of q = k root(P(q) - P_m).
  double valve_flow(double coefficient, double measured, double manifold, double time) const;
  double manifold_compliance(double pressure) const;

  double density_, sound_speed_, specific_heat_, valve_coefficient_, valve_time_, manifold_volume_, drain_pressure_,
      water_temperature_, ambient_temperature_, firing_time_;
  int supply_, valve_command_, heat_command_;  // channels that drive
  const EffectChain &supply_port_, &water_port_, &manifold_port_, &feed_line_, &valve_port_;
  std::vector<Branch> branches_;
  int feed_ = -1, count_;  // state of the pressure over the valve, if the feed line has inertia
  // While the state of rest is sought nothing has inertia and the manifold is stiff: neither changes where it ends.
  bool at_rest_ = false;
  std::vector<std::pair<int, int>> entries_, rest_entries_;
  std::vector<std::string> state_names_;
  std::size_t channels_;
};

}  // namespace faultline
