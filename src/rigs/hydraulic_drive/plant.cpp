#include "rigs/hydraulic_drive/plant.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "faultline/rig/orifice.h"

namespace faultline {
namespace {

enum { kValveStage, kSpool, kPressure, kSpeed, kStates };

constexpr double kTransition = 1e4;           // Pa, e of R
constexpr double kVoltageLimit = 5;           // V
constexpr double kReturnPressure = 2e5;       // Pa absolute, where P_m is 0
constexpr double kSmallestInertance = 2e6;    // Pa s^2/m^3; with less the column swings faster than the step can follow
constexpr double kSmallestCompliance = 1e-3;  // rad/(N m), of a coupling that is stiff; for the same reason
constexpr double kStiffDamping = 0.3;         // N m s/rad, of that coupling
constexpr double kHighestPressure = 5e7;      // Pa, within which the state of rest is sought
constexpr int kFlowSteps = 3;                 // of Newton's method; droop moves the flow by a tenth
constexpr int kHalvings = 80;                 // of the interval that holds the pressure at rest

}  // namespace

HydraulicDrive::HydraulicDrive(const Datasheet& sheet, const std::vector<double>& parameters, const EffectSet& effects)
    : force_port_(effects.at("force.shaft")),
      leak_port_(effects.at("flow.motor_in_motor_out")),
      valve_port_(effects.at("restriction.valve")),
      compliance_port_(effects.at("compliance.motor_line")),
      supply_port_(effects.at("source.supply")),
      oil_port_(effects.at("source.oil")),
      motor_port_(effects.at("transmission.motor")),
      pump_port_(effects.at("transmission.pump")),
      displacement_port_(effects.at("transmission.displacement")),
      shaft_port_(effects.at("transmission.shaft")),
      line_port_(effects.at("line.motor")) {
  check_state_names(sheet, {"valve_stage", "spool_position", "motor_pressure", "shaft_speed"});
  const auto value = [&](const char* name) { return parameters[static_cast<std::size_t>(sheet.parameter(name))]; };
  valve_time_1_ = value("valve_time_constant_1");
  valve_time_2_ = value("valve_time_constant_2");
  valve_gain_ = value("valve_gain");
  flow_coefficient_ = value("flow_coefficient");
  displacement_ = value("displacement");
  volume_ = value("trapped_volume");
  bulk_modulus_ = value("bulk_modulus");
  leakage_ = value("leakage_coefficient");
  motor_efficiency_ = value("motor_efficiency");
  pump_efficiency_ = value("pump_efficiency");
  inertia_ = value("inertia");
  friction_ = value("viscous_friction");
  command_ = sheet.channel("valve_voltage");
  supply_ = sheet.channel("supply_pressure");
  load_ = sheet.channel("pump_pressure");
  out_pressure_ = sheet.channel("motor_pressure");
  out_speed_ = sheet.channel("shaft_speed");
  const auto take_two = [&] { return std::exchange(count_, count_ + 2); };
  if (!line_port_.empty()) line_ = take_two();
  if (!shaft_port_.empty()) spring_ = take_two();
  changing_ = !displacement_port_.empty() || !oil_port_.empty() || !motor_port_.empty() || !pump_port_.empty();
  values_ = values_now();
  valve_rate_1_ = 1 / valve_time_1_;
  valve_rate_2_ = 1 / valve_time_2_;
}

const HydraulicDrive::Values& HydraulicDrive::values() {
  if (changing_) values_ = values_now();
  return values_;
}

HydraulicDrive::Values HydraulicDrive::values_now() const {
  const double displacement = displacement_ * (displacement_port_.empty() ? 1.0 : displacement_port_.coupling().factor);
  const double viscosity = oil_port_.empty() ? 1.0 : oil_port_.viscosity().factor;
  return {displacement, displacement * motor_efficiency_ * (motor_port_.empty() ? 1.0 : motor_port_.coupling().factor),
          displacement / pump_efficiency_ * (pump_port_.empty() ? 1.0 : pump_port_.coupling().factor),
          friction_ * viscosity, leakage_ / viscosity};
}

double HydraulicDrive::valve_flow(double time, double spool, double pressure, const double* channels) const {
  const double opening = flow_coefficient_ * valve_port_.opening(spool);
  const double back = opening > 0 ? pressure : opening < 0 ? -pressure : 0.0;
  if (supply_port_.empty()) return opening * signed_root(channels[supply_] - back, kTransition);
  // The supply may fall with the flow drawn from it, q = |opening| R(P(q) - back), which rises less than q.
  const auto supply = [&](double drawn) { return supply_port_.boundary(channels[supply_], drawn, time); };
  const double still = supply(0), fall = still - supply(1);
  double q = std::abs(opening) * signed_root(still - back, kTransition);
  for (int i = 0; i < kFlowSteps && fall > 0; ++i) {
    const double drop = still - fall * q - back;
    const auto [root, slope] = signed_root_and_slope(drop, kTransition);
    q -= (q - std::abs(opening) * root) / (1 + std::abs(opening) * slope * fall);
  }
  return opening < 0 ? -q : q;
}

double HydraulicDrive::motor_speed(const double* state) const { return state[spring_ < 0 ? kSpeed : spring_]; }

Coupling HydraulicDrive::spring() const {
  Coupling coupling = shaft_port_.coupling();
  if (coupling.compliance <= 0) coupling.damping = kStiffDamping;
  coupling.compliance = std::max(coupling.compliance, kSmallestCompliance);
  return coupling;
}

double HydraulicDrive::load_torque(const Values& now, double speed, const double* channels) const {
  double torque = now.pump_torque * channels[load_];
  if (!force_port_.empty()) torque += force_port_.forces({0, speed, 0}).applied;
  return torque;
}

HydraulicDrive::Shaft HydraulicDrive::shaft(const Values& now, const double* state, const double* channels) const {
  const double speed = motor_speed(state);
  const double share = spring_ < 0 ? 1.0 : 0.5;
  const double load = spring_ < 0 ? load_torque(now, speed, channels) : state[spring_ + 1];
  Shaft body{now.motor_torque * state[kPressure] - share * now.friction * speed - load, share * inertia_, 0, 0, 0, 0};
  if (spring_ >= 0) body.torque -= spring().damping * (speed - state[kSpeed]);
  if (!force_port_.empty()) {
    const BodyForces extra = force_port_.forces({0, speed, std::abs(state[kPressure])});
    body.torque -= extra.viscous;
    body.inertia += extra.mass;
    body.sliding_plus = std::max(0.0, extra.sliding_plus);
    body.sliding_minus = std::max(0.0, extra.sliding_minus);
    body.breakaway_plus = std::max(body.sliding_plus, extra.breakaway_plus);
    body.breakaway_minus = std::max(body.sliding_minus, extra.breakaway_minus);
  }
  return body;
}

// P_m gives the flow that is left for the shaft, and so its speed, which falls with P_m; the torque that is left rises
// with P_m, by a step where the speed changes sign under dry friction. Its zero is the state of rest.
void HydraulicDrive::start(const double* channels, double* state) {
  const Values now = values();
  const double voltage = std::clamp(channels[command_], -kVoltageLimit, kVoltageLimit);
  double nominal[kStates] = {valve_gain_ * voltage, valve_gain_ * voltage, 0, 0};
  double low = -kHighestPressure, high = kHighestPressure;
  const auto excess_torque = [&](double pressure) {
    const double leak = now.leakage * pressure + leak_port_.flow({pressure, pressure, 0});
    const double speed = (valve_flow(0, nominal[kSpool], pressure, channels) - leak) / now.displacement;
    nominal[kPressure] = pressure;
    nominal[kSpeed] = speed;
    double torque = now.motor_torque * pressure - now.friction * speed - load_torque(now, speed, channels);
    if (force_port_.empty()) return torque;
    const BodyForces extra = force_port_.forces({0, speed, std::abs(pressure)});
    return torque - extra.viscous - (speed > 0 ? extra.sliding_plus : speed < 0 ? -extra.sliding_minus : 0.0);
  };
  for (int i = 0; i < kHalvings; ++i) (excess_torque((low + high) / 2) < 0 ? low : high) = (low + high) / 2;
  excess_torque(high);
  const double slower = nominal[kSpeed];
  excess_torque(low);
  if (nominal[kSpeed] > 0 && slower < 0) nominal[kSpeed] = 0;  // dry friction holds the shaft
  start_at(nominal, channels, state);
  set_modes(state);
}

void HydraulicDrive::start_at(const double* nominal_state, const double* channels, double* state) {
  std::copy_n(nominal_state, static_cast<int>(kStates), state);
  if (line_ >= 0) {
    const Values now = values();
    state[line_] = state[kPressure];
    state[line_ + 1] = now.displacement * state[kSpeed] + now.leakage * state[kPressure];
  }
  if (spring_ >= 0) {
    const Values now = values();
    state[spring_] = state[kSpeed];
    state[spring_ + 1] = load_torque(now, state[kSpeed], channels) + 0.5 * now.friction * state[kSpeed];
  }
}

void HydraulicDrive::set_modes(const double* state) { dry_friction_.start(motor_speed(state)); }

void HydraulicDrive::derivative(double time, const double* state, const double* channels, double* rate) {
  const Values& now = values();
  const double pressure = state[kPressure];
  const double voltage = std::clamp(channels[command_], -kVoltageLimit, kVoltageLimit);
  rate[kValveStage] = (valve_gain_ * voltage - state[kValveStage]) * valve_rate_1_;
  rate[kSpool] = (state[kValveStage] - state[kSpool]) * valve_rate_2_;

  const auto softness = [&](double at) {  // B/V of what the port's effects leave of B
    return compliance_port_.bulk_modulus(bulk_modulus_, at + kReturnPressure) / (line_ < 0 ? volume_ : volume_ / 2);
  };
  const double leak = now.leakage * pressure + leak_port_.flow({pressure, pressure, 0});
  const double taken = now.displacement * motor_speed(state) + leak;
  if (line_ < 0) {
    rate[kPressure] = softness(pressure) * (valve_flow(time, state[kSpool], pressure, channels) - taken);
  } else {
    const double at_valve = state[line_];
    rate[kPressure] = softness(pressure) * (state[line_ + 1] - taken);
    rate[line_] = softness(at_valve) * (valve_flow(time, state[kSpool], at_valve, channels) - state[line_ + 1]);
    rate[line_ + 1] = (at_valve - pressure) / std::max(line_port_.line().inertance, kSmallestInertance);
  }

  const Shaft body = shaft(now, state, channels);
  const bool stands = body.dry() && dry_friction_.stuck();
  const double rise =
      stands ? 0.0 : (body.torque - dry_friction_.force(body.sliding_plus, body.sliding_minus)) / body.inertia;
  if (spring_ < 0) {
    rate[kSpeed] = rise;
    return;
  }
  const Coupling coupling = spring();
  const double slip = state[spring_] - state[kSpeed];
  rate[spring_] = rise;
  rate[spring_ + 1] = slip / coupling.compliance;
  rate[kSpeed] = (state[spring_ + 1] + coupling.damping * slip - 0.5 * now.friction * state[kSpeed] -
                  load_torque(now, state[kSpeed], channels)) /
                 (0.5 * inertia_);
}

void HydraulicDrive::after_step(double, double* state, const double* channels) {
  if (force_port_.empty()) return;
  const Shaft body = shaft(values(), state, channels);
  double& speed = state[spring_ < 0 ? static_cast<int>(kSpeed) : spring_];
  // A shaft that is driven through standstill keeps its speed; stopped for a step, it would lose up to that step's.
  const bool through = speed * dry_friction_.direction() < 0 &&
                       (speed < 0 ? body.torque < -body.breakaway_minus : body.torque > body.breakaway_plus);
  if (body.dry() && !through)
    dry_friction_.after_step(speed, body.torque, body.breakaway_plus, body.breakaway_minus);
  else
    dry_friction_.start(speed);
}

void HydraulicDrive::outputs(double, const double* state, double* channels) const {
  channels[out_pressure_] = state[kPressure];
  channels[out_speed_] = state[kSpeed];
}

double HydraulicDrive::drawn(int channel, double time, const double* state, const double* channels) const {
  if (channel != supply_) return 0;
  return std::abs(valve_flow(time, state[kSpool], state[line_ < 0 ? static_cast<int>(kPressure) : line_], channels));
}

namespace {
FAULTLINE_RIG(hydraulic_drive, {"hydraulic_drive", 0.5e-3, make_rig<HydraulicDrive>, 2.5e-3, 0, 1.25e-3});
}

}  // namespace faultline
