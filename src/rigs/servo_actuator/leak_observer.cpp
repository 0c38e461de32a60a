// The servo actuator as the divided difference filter sees it, with internal leak and friction as random walks.
// Source: Mahulkar et al. 2011, equations (5), (6), (36)-(45), Euler steps of the sample period; config/servo_actuator.
//
//   x1..x4 = x, v, P_L/S_c3, x_v/S_c4;  x5 = C_tm/(K S_c4), the scaled leak;  x6 = friction correction [m/s^2]
//   x2+ = x2 + T (theta1 (x3 - bbar x2 - (F_fc(x2) + F_load)/(A S_c3)) + x6)
//   x3+ = x3 + T theta3 (-Abar x2 - x5 root(x3) + x4 sqrt(max(0, P_s/S_c3 - sgn(x4) x3)))
//   x4+ = x4 + T (-x4 + k_v i/S_c4)/tau_v
//   theta1 = A S_c3/m, theta3 = K S_c4/(compliance sqrt(S_c3)), Abar = A/(K S_c4 sqrt(S_c3)), bbar = b/(A S_c3)
// F_fc uses tanh(v/0.005 m/s): the filter needs no sticking, x6 takes what is missing. Blind to the leak while P_L is
// near zero (standstill): x5 then only drifts, and its covariance says so.
#include <algorithm>
#include <cmath>

#include "faultline/estimators/process_model.h"
#include "faultline/rig/orifice.h"

namespace faultline {
namespace {

enum { kPosition, kVelocity, kPressure, kSpool, kLeak, kFriction, kStates };

constexpr double kFrictionWidth = 0.005;  // m/s
constexpr double kTransition = 1000;      // Pa, of the leak's orifice

class ServoLeakModel : public ProcessModel {
 public:
  ServoLeakModel(const Datasheet& sheet, const Settings& settings) {
    const std::vector<double> nominal = sheet.nominal();
    const auto value = [&](const char* name) { return nominal[static_cast<std::size_t>(sheet.parameter(name))]; };
    area_ = value("ram_area");
    mass_ = value("moving_mass");
    coulomb_ = value("coulomb_friction");
    static_excess_ = value("static_excess");
    stribeck_velocity_ = value("stribeck_velocity");
    spool_time_ = value("spool_time_constant");
    spool_gain_ = value("spool_gain");
    flow_coefficient_ = value("flow_coefficient");
    scale_pressure_ = settings.number("scale_pressure", 1e-6, 1e9);
    scale_spool_ = settings.number("scale_spool", 1e-6, 1e6);
    theta1_ = area_ * scale_pressure_ / mass_;
    theta3_ = flow_coefficient_ * scale_spool_ / (value("compliance") * std::sqrt(scale_pressure_));
    area_bar_ = area_ / (flow_coefficient_ * scale_spool_ * std::sqrt(scale_pressure_));
    damping_bar_ = value("viscous_damping") / (area_ * scale_pressure_);
    process_noise_ = settings.list("process_noise", kStates, 0, 1e12);
    measurement_noise_ = settings.list("measurement_noise", 4, 1e-30, 1e12);
    initial_variance_ = settings.list("initial_variance", kStates, 0, 1e12);
    command_ = sheet.channel("valve_command");
    supply_ = sheet.channel("supply_pressure");
    load_force_ = sheet.channel("load_force");
    measured_ = {sheet.channel("position"), sheet.channel("velocity"), sheet.channel("load_pressure"),
                 sheet.channel("spool_position")};
    chamber_a_ = sheet.channel("chamber_a_pressure");
    chamber_b_ = sheet.channel("chamber_b_pressure");
  }

  std::vector<State> states() const override {
    return {{"position", "x_L", "m"},          {"velocity", "v", "m/s"},
            {"load_pressure", "P_L", "S_c3"},  {"spool_position", "x_v", "S_c4"},
            {"leak_coefficient", "C_tm", "1"}, {"friction_correction", "x6", "m/s^2"}};
  }
  std::vector<int> measured_channels() const override { return measured_; }
  std::vector<int> driving_channels() const override { return {command_, supply_, load_force_}; }
  std::vector<double> process_noise() const override { return process_noise_; }
  std::vector<double> measurement_noise() const override { return measurement_noise_; }

  void initial(const double* channels, double* state, double* variance) const override {
    measurement(channels, state);
    state[kLeak] = state[kFriction] = 0;
    std::copy(initial_variance_.begin(), initial_variance_.end(), variance);
  }

  void take_inputs(const double* channels) override {
    voltage_ = channels[command_];
    supply_scaled_ = channels[supply_] / scale_pressure_;
    load_ = channels[load_force_] / (area_ * scale_pressure_);
  }

  void measurement(const double* channels, double* y) const override {
    y[0] = channels[measured_[0]];
    y[1] = channels[measured_[1]];
    y[2] = channels[measured_[2]] / scale_pressure_;
    y[3] = channels[measured_[3]] / scale_spool_;
  }

  void predict(const double* x, double dt, double* next) const override {
    const double v = x[kVelocity];
    const double friction = dry_friction(v) / (area_ * scale_pressure_);
    const double drop = supply_scaled_ - (x[kSpool] > 0 ? x[kPressure] : x[kSpool] < 0 ? -x[kPressure] : 0.0);
    const double velocity_rate = theta1_ * (x[kPressure] - damping_bar_ * v - friction - load_) + x[kFriction];
    const double pressure_rate =
        theta3_ * (-area_bar_ * v - x[kLeak] * signed_root(x[kPressure], kTransition / scale_pressure_) +
                   x[kSpool] * std::sqrt(std::max(0.0, drop)));
    next[kPosition] = x[kPosition] + dt * v;
    next[kVelocity] = v + dt * velocity_rate;
    next[kPressure] = x[kPressure] + dt * pressure_rate;
    next[kSpool] = x[kSpool] + dt * (spool_gain_ * voltage_ / scale_spool_ - x[kSpool]) / spool_time_;
    next[kLeak] = x[kLeak];
    next[kFriction] = x[kFriction];
  }

  void observe(const double* x, double* y) const override { std::copy_n(x, 4, y); }

  bool jacobian(const double* x, double dt, double* a) const override {
    const double v = x[kVelocity], ratio = v / stribeck_velocity_, width = std::tanh(v / kFrictionWidth);
    const double excess = static_excess_ * std::exp(-ratio * ratio);
    const double friction_slope =
        -2 * ratio / stribeck_velocity_ * excess * width + (coulomb_ + excess) * (1 - width * width) / kFrictionWidth;
    const double transition = kTransition / scale_pressure_;
    const double square = x[kPressure] * x[kPressure] + transition * transition;
    const double leak_root = signed_root(x[kPressure], transition);
    const double leak_slope = (0.5 * x[kPressure] * x[kPressure] + transition * transition) * std::pow(square, -1.25);
    const double sign = x[kSpool] > 0 ? 1 : x[kSpool] < 0 ? -1 : 0;
    const double drop = std::sqrt(std::max(0.0, supply_scaled_ - sign * x[kPressure]));
    std::fill_n(a, kStates * kStates, 0.0);
    const auto entry = [a](int row, int column) -> double& { return a[row * kStates + column]; };
    for (int i = 0; i < kStates; ++i) entry(i, i) = 1;
    entry(kPosition, kVelocity) = dt;
    entry(kVelocity, kVelocity) -= dt * theta1_ * (damping_bar_ + friction_slope / (area_ * scale_pressure_));
    entry(kVelocity, kPressure) = dt * theta1_;
    entry(kVelocity, kFriction) = dt;
    entry(kPressure, kVelocity) = -dt * theta3_ * area_bar_;
    entry(kPressure, kPressure) -=
        dt * theta3_ * (x[kLeak] * leak_slope + (drop > 0 ? 0.5 * std::abs(x[kSpool]) / drop : 0.0));
    entry(kPressure, kSpool) = dt * theta3_ * drop;
    entry(kPressure, kLeak) = -dt * theta3_ * leak_root;
    entry(kSpool, kSpool) -= dt / spool_time_;
    return true;
  }
  std::vector<int> observed_states() const override { return {kPosition, kVelocity, kPressure, kSpool}; }

  void quantities(const double* channels, const double* x, const double* covariance,
                  std::vector<Quantity>& result) const override {
    if (result.empty())
      result = {{"leak_coefficient", "m^3/(s sqrt(Pa))", 0, 0},
                {"leak_flow", "m^3/s", 0, 0},
                {"friction_force", "N", 0, 0},
                {"pressure_parity", "Pa", 0, 0},
                {"pressure_sum", "Pa", 0, 0},
                {"leak_drive", "sqrt(Pa)", 0, 0},
                {"piston_flow", "m^3/s", 0, 0}};
    const double to_coefficient = flow_coefficient_ * scale_spool_;
    const double std_leak = std::sqrt(std::max(0.0, covariance[kLeak * kStates + kLeak]));
    const double drive = std::sqrt(std::abs(x[kPressure]) * scale_pressure_);
    result[0].value = x[kLeak] * to_coefficient;
    result[0].std = std_leak * to_coefficient;
    result[1].value = x[kLeak] * to_coefficient * drive;
    result[1].std = std_leak * to_coefficient * drive;
    result[2].value = -mass_ * x[kFriction];
    result[2].std = mass_ * std::sqrt(std::max(0.0, covariance[kFriction * kStates + kFriction]));
    const double a = channels[chamber_a_], b = channels[chamber_b_];
    result[3].value = channels[measured_[2]] - (a - b);
    result[4].value = a + b - channels[supply_];
    result[5].value = drive;
    result[6].value = area_ * x[kVelocity];
  }

 private:
  double dry_friction(double v) const {
    // Most of a filter's probes differ from the last in other states than the velocity.
    if (v == friction_velocity_) return friction_;
    friction_velocity_ = v;
    const double ratio = v / stribeck_velocity_;
    const double level = coulomb_ + (std::abs(ratio) < 6 ? static_excess_ * std::exp(-ratio * ratio) : 0.0);
    // tanh is 1 to nine digits beyond ten widths: most samples while moving.
    const double reach = v / kFrictionWidth;
    friction_ = level * (reach > 10 ? 1.0 : reach < -10 ? -1.0 : std::tanh(reach));
    return friction_;
  }

  double area_, mass_, coulomb_, static_excess_, stribeck_velocity_, spool_time_, spool_gain_, flow_coefficient_,
      scale_pressure_, scale_spool_, theta1_, theta3_, area_bar_, damping_bar_;
  std::vector<double> process_noise_, measurement_noise_, initial_variance_;
  int command_, supply_, load_force_, chamber_a_, chamber_b_;
  std::vector<int> measured_;
  double voltage_ = 0, supply_scaled_ = 0, load_ = 0;
  mutable double friction_velocity_ = 0, friction_ = 0;  // N, the last that was asked for; 0 at standstill
};

FAULTLINE_PROCESS_MODEL(servo_leak, {"servo_leak", make_process_model_of<ServoLeakModel>});

}  // namespace
}  // namespace faultline
