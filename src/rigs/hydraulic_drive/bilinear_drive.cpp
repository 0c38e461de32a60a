// The hydraulic drive as a bilinear system, for observers with unknown inputs.
// Source: Yu, Control Engineering Practice 5 (1997), equations (11)-(17); config/hydraulic_drive has all symbols.
//
//   x = (x_1, X_s, P_m, S_s),  u = (v, R, P_p),  y = (P_m, S_s),  R = R(P_s - sgn(v) P_m), a measured root
//   x_1' = (K_s v - x_1)/T_1,  X_s' = (x_1 - X_s)/T_2
//   P_m' = B/V_t (K_0 X_s R - C_r S_s - K_l P_m)              the one product, A_R
//   S_s' = (C_r eta_m P_m - D S_s - C_r/eta_p P_p)/I
// With the root as an input nothing is linearised. The sign is the voltage's, since no spool position is measured: it
// is wrong while the spool crosses zero. Below kLeastPressure at the motor nothing is said: what air there is in
// the oil then makes the line soft. As decoupling.h has it:
//   unknown on shaft_speed (torques, friction, load): decoupled; the residual is the flow balance of valve, line and
//     motor. Not strict: X_s is not measured, so T A_R M != 0 and the error's coefficients contain R. They form a
//     cascade, valve before line, whose poles R does not touch.
//   unknown on motor_pressure (valve, leakage, compliance): decoupled and strict; the residual is the torque balance.
//   unknown on both: nothing is left.
#include <cmath>

#include "faultline/estimators/bilinear_model.h"
#include "faultline/rig/orifice.h"

namespace faultline {
namespace {

enum { kStage, kSpool, kPressure, kSpeed, kStates };
enum { kVoltage, kRoot, kLoad, kInputs };

constexpr double kTransition = 1e4;                         // Pa, of the root
constexpr double kLeastPressure = 0;                        // Pa, at the motor: below it the line's air expands
constexpr double kLeastDrop = 5e6, kGreatestDrop = 1.45e7;  // Pa, over the valve: 145 bar less 0..95 bar at the motor

class BilinearDrive : public BilinearModel {
 public:
  BilinearDrive(const Datasheet& sheet, const Settings&)
      : t1_(at(sheet, "valve_time_constant_1")),
        t2_(at(sheet, "valve_time_constant_2")),
        ks_(at(sheet, "valve_gain")),
        k0_(at(sheet, "flow_coefficient")),
        cr_(at(sheet, "displacement")),
        vt_(at(sheet, "trapped_volume")),
        b_(at(sheet, "bulk_modulus")),
        kl_(at(sheet, "leakage_coefficient")),
        etam_(at(sheet, "motor_efficiency")),
        etap_(at(sheet, "pump_efficiency")),
        i_(at(sheet, "inertia")),
        d_(at(sheet, "viscous_friction")),
        v_(sheet.channel("valve_voltage")),
        ps_(sheet.channel("supply_pressure")),
        pp_(sheet.channel("pump_pressure")),
        pm_(sheet.channel("motor_pressure")),
        ss_(sheet.channel("shaft_speed")),
        states_(sheet.states) {
    const auto& load = sheet.channels[static_cast<std::size_t>(pp_)];
    inputs_ = {{"valve_voltage", "V", true, 0, 2},
               {"valve_root", "Pa^0.5", false, std::sqrt(kLeastDrop), std::sqrt(kGreatestDrop)},
               {"pump_pressure", "Pa", false, load.minimum, load.maximum}};
  }

  std::vector<State> states() const override { return states_; }
  std::vector<BilinearInput> inputs() const override { return inputs_; }
  std::vector<int> measured_channels() const override { return {pm_, ss_}; }
  std::vector<int> driving_channels() const override { return {v_, ps_, pp_}; }

  BilinearSystem system(const std::vector<double>& p) const override {
    BilinearSystem s;
    s.a.setZero(kStates, kStates);
    s.b.setZero(kStates, kInputs);
    s.c.setZero(2, kStates);
    s.products.resize(kInputs);
    s.products[kRoot].setZero(kStates, kStates);
    const double stiffness = p[b_] / p[vt_];
    s.a(kStage, kStage) = -1 / p[t1_];
    s.b(kStage, kVoltage) = p[ks_] / p[t1_];
    s.a(kSpool, kStage) = 1 / p[t2_];
    s.a(kSpool, kSpool) = -1 / p[t2_];
    s.products[kRoot](kPressure, kSpool) = stiffness * p[k0_];
    s.a(kPressure, kSpeed) = -stiffness * p[cr_];
    s.a(kPressure, kPressure) = -stiffness * p[kl_];
    s.a(kSpeed, kPressure) = p[cr_] * p[etam_] / p[i_];
    s.a(kSpeed, kSpeed) = -p[d_] / p[i_];
    s.b(kSpeed, kLoad) = -p[cr_] / (p[etap_] * p[i_]);
    s.c(0, kPressure) = s.c(1, kSpeed) = 1;
    return s;
  }

  void take_inputs(const double* channels, double* u) const override {
    const double sign = channels[v_] < 0 ? -1 : 1;
    u[kVoltage] = channels[v_];
    u[kRoot] =
        channels[pm_] < kLeastPressure ? std::nan("") : signed_root(channels[ps_] - sign * channels[pm_], kTransition);
    u[kLoad] = channels[pp_];
  }

 private:
  static std::size_t at(const Datasheet& sheet, const char* name) {
    return static_cast<std::size_t>(sheet.parameter(name));
  }

  std::size_t t1_, t2_, ks_, k0_, cr_, vt_, b_, kl_, etam_, etap_, i_, d_;  // parameters
  int v_, ps_, pp_, pm_, ss_;                                               // channels
  std::vector<State> states_;
  std::vector<BilinearInput> inputs_;
};

FAULTLINE_BILINEAR_MODEL(bilinear_drive, {"bilinear_drive", make_bilinear_model_of<BilinearDrive>});

}  // namespace
}  // namespace faultline
