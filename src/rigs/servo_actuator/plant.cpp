#include "rigs/servo_actuator/plant.h"

#include <algorithm>
#include <cmath>

#include "faultline/numerics/cubic_table.h"
#include "faultline/rig/orifice.h"

namespace faultline {
namespace {

enum { kPosition, kVelocity, kPressureA, kPressureB, kSpool, kLeakSpool, kMeter };

constexpr double kTransition = 1000;         // Pa, below which orifices turn laminar
constexpr double kSpoolLimit = 10;           // V
constexpr double kValveNodeShare = 0.2;      // of V_0, on the valve side of a hose
constexpr double kSmallestInertance = 2e5;   // Pa s^2/m^3; less resonates above 1 kHz, faster than the step can follow
constexpr double kAtmosphere = 101325;       // Pa, between gauge and absolute
constexpr double kContactStiffness = 2.0e7;  // N/m, of a coupling that is stiff: steel on steel, as the stops
constexpr double kContactDamping = 2.0e3;    // N s/m
const double kRootTwo = std::sqrt(2.0);

// exp(-x^2) within 1e-9, in half the time.
const CubicTable<512> bell_of_positive(
    0, 6, [](double x) { return std::exp(-x * x); }, [](double x) { return -2 * x * std::exp(-x * x); });

}  // namespace

ServoActuator::ServoActuator(const Datasheet& sheet, const std::vector<double>& parameters, const EffectSet& effects)
    : force_port_(effects.at("force.piston")),
      leak_port_(effects.at("flow.chamber_a_chamber_b")),
      leak_a_port_(effects.at("flow.chamber_a_tank")),
      leak_b_port_(effects.at("flow.chamber_b_tank")),
      compliance_port_(effects.at("compliance.chambers")),
      valve_port_(effects.at("restriction.valve")),
      supply_port_(effects.at("source.supply_pressure")),
      line_port_(effects.at("line.valve_cylinder")),
      rod_port_(effects.at("transmission.rod")) {
  check_state_names(sheet, {"position", "velocity", "chamber_a_pressure", "chamber_b_pressure", "spool_position",
                            "leak_spool", "metered_flow"});
  const auto value = [&](const char* name) { return parameters[static_cast<std::size_t>(sheet.parameter(name))]; };
  area_ = value("ram_area");
  mass_ = value("moving_mass");
  damping_ = value("viscous_damping");
  coulomb_ = value("coulomb_friction");
  static_excess_ = value("static_excess");
  stribeck_velocity_ = value("stribeck_velocity");
  chamber_volume_ = value("chamber_volume");
  bulk_modulus_ = chamber_volume_ / (2 * value("compliance"));
  flow_coefficient_ = value("flow_coefficient");
  spool_time_ = value("spool_time_constant");
  spool_gain_ = value("spool_gain");
  leak_gain_ = value("leak_valve_gain");
  leak_time_ = value("leak_valve_time_constant");
  meter_time_ = value("flow_meter_time_constant");
  stroke_ = value("stroke_limit");
  stop_stiffness_ = value("stop_stiffness");
  stop_damping_ = value("stop_damping");
  load_mass_share_ = value("load_mass_share");
  load_friction_share_ = value("load_friction_share");
  root_coefficient_ = flow_coefficient_ * kRootTwo;
  spool_rate_ = 1 / spool_time_;
  leak_rate_ = 1 / leak_time_;
  meter_rate_ = 1 / meter_time_;
  stribeck_scale_ = 1 / stribeck_velocity_;

  command_ = sheet.channel("valve_command");
  leak_command_ = sheet.channel("leak_valve_command");
  supply_ = sheet.channel("supply_pressure");
  load_force_ = sheet.channel("load_force");
  out_position_ = sheet.channel("position");
  out_velocity_ = sheet.channel("velocity");
  out_pressure_ = sheet.channel("load_pressure");
  out_a_ = sheet.channel("chamber_a_pressure");
  out_b_ = sheet.channel("chamber_b_pressure");
  out_spool_ = sheet.channel("spool_position");
  out_leak_flow_ = sheet.channel("leak_flow");

  has_line_ = !line_port_.empty();
  has_load_ = !rod_port_.empty();
  has_force_ = !force_port_.empty();
  has_droop_ = !supply_port_.empty();
  bare_ = !has_force_ && !has_load_;
  if (has_line_) {
    line_ = count_;
    count_ += 4;
  }
  if (has_load_) {
    load_ = count_;
    count_ += 2;
  }
}

void ServoActuator::start(const double* channels, double* state) {
  const double half = channels[supply_] / 2;
  const double nominal[7] = {0, 0, half, half, 0, 0, 0};
  start_at(nominal, channels, state);
  set_modes(state);
}

void ServoActuator::start_at(const double* nominal_state, const double*, double* state) {
  std::copy_n(nominal_state, 7, state);
  if (has_line_) {
    state[line_] = state[kPressureA];
    state[line_ + 1] = state[kPressureB];
    state[line_ + 2] = area_ * state[kVelocity];
    state[line_ + 3] = area_ * state[kVelocity];
  }
  if (has_load_) {
    state[load_] = state[kPosition];
    state[load_ + 1] = state[kVelocity];
  }
}

void ServoActuator::set_modes(const double* state) {
  piston_friction_.start(state[kVelocity]);
  if (has_load_) load_friction_.start(state[load_ + 1]);
}

int ServoActuator::motion(const double* state) const {
  // A piston that has just broken loose still stands; its velocity alone would call it stuck.
  const bool loose = !piston_friction_.stuck() && state[kVelocity] == 0;
  if (!bare_ || has_line_ || loose || std::abs(state[kPosition]) > stroke_) return kUneven;
  return 1 + piston_friction_.direction();
}

double ServoActuator::stop_force(double position, double velocity) const {
  if (position > stroke_) return std::max(0.0, stop_stiffness_ * (position - stroke_) + stop_damping_ * velocity);
  if (position < -stroke_) return std::min(0.0, stop_stiffness_ * (position + stroke_) + stop_damping_ * velocity);
  return 0;
}

double ServoActuator::coupling_force(const double* state) const {
  const Coupling coupling = rod_port_.coupling();
  const double stiffness = 1 / (1 / kContactStiffness + coupling.compliance);
  const double damping = coupling.compliance > 0 ? coupling.damping : kContactDamping;
  const double apart = state[kPosition] - state[load_];
  const double speed = state[kVelocity] - state[load_ + 1];
  const double half = coupling.gap / 2;
  if (half <= 0) return stiffness * apart + damping * speed;
  if (apart > half) return std::max(0.0, stiffness * (apart - half) + damping * speed);
  if (apart < -half) return std::min(0.0, stiffness * (apart + half) + damping * speed);
  return 0;
}

double ServoActuator::stribeck(double velocity) const {
  const double ratio = std::abs(velocity * stribeck_scale_);
  return bell_of_positive.holds(ratio) ? static_excess_ * bell_of_positive(ratio) : 0.0;
}

ServoActuator::Body ServoActuator::piston(const double* state, double coupling) const {
  const double velocity = state[kVelocity];
  const double drop = state[kPressureA] - state[kPressureB];
  const double share = has_load_ ? 1 - load_friction_share_ : 1.0;
  Body body;
  body.mass = has_load_ ? mass_ * (1 - load_mass_share_) : mass_;
  body.sliding_plus = body.sliding_minus = share * (coulomb_ + stribeck(velocity));
  body.breakaway_plus = body.breakaway_minus = share * (coulomb_ + static_excess_);
  body.force = drop * area_ - share * damping_ * velocity - stop_force(state[kPosition], velocity);
  if (has_force_) {
    const BodyForces extra = force_port_.forces({state[kPosition], velocity, std::abs(drop)});
    body.mass += extra.mass;
    body.sliding_plus = std::max(0.0, body.sliding_plus + extra.sliding_plus);
    body.sliding_minus = std::max(0.0, body.sliding_minus + extra.sliding_minus);
    body.breakaway_plus = std::max(body.sliding_plus, body.breakaway_plus + extra.breakaway_plus);
    body.breakaway_minus = std::max(body.sliding_minus, body.breakaway_minus + extra.breakaway_minus);
    body.force -= extra.viscous;
    if (!has_load_) body.force -= extra.applied;
  }
  body.force -= coupling;
  return body;
}

ServoActuator::Body ServoActuator::load(const double* state, double coupling, const double* channels) const {
  const double position = state[load_], velocity = state[load_ + 1];
  Body body;
  body.mass = mass_ * load_mass_share_;
  body.sliding_plus = body.sliding_minus = load_friction_share_ * (coulomb_ + stribeck(velocity));
  body.breakaway_plus = body.breakaway_minus = load_friction_share_ * (coulomb_ + static_excess_);
  body.force = coupling - load_friction_share_ * damping_ * velocity - channels[load_force_];
  if (has_force_) body.force -= force_port_.forces({position, velocity, 0, false}).applied;
  return body;
}

double ServoActuator::acceleration(const double* state, double coupling) const {
  if (bare_) {
    const double velocity = state[kVelocity];
    const double friction = coulomb_ + stribeck(velocity);
    return ((state[kPressureA] - state[kPressureB]) * area_ - damping_ * velocity -
            stop_force(state[kPosition], velocity) - coupling - piston_friction_.force(friction, friction)) /
           mass_;
  }
  const Body body = piston(state, coupling);
  return (body.force - piston_friction_.force(body.sliding_plus, body.sliding_minus)) / body.mass;
}

double ServoActuator::drooped(double time, const double* state, double measured) const {
  // Flow drawn from P, taken at the pressure without droop: one step of the fixed point, exact to second order in the
  // droop.
  const double ahead = root_coefficient_ * valve_port_.edge(state[kSpool]);
  const double astern = root_coefficient_ * valve_port_.edge(-state[kSpool]);
  const double before = supply_port_.boundary(measured, 0, time);
  const double node_a = has_line_ ? state[line_] : state[kPressureA];
  const double node_b = has_line_ ? state[line_ + 1] : state[kPressureB];
  double drawn = 0, pressure = before;
  for (int i = 0; i < 3; ++i) {
    drawn = (ahead > 0 ? std::max(0.0, ahead * signed_root(pressure - node_a, kTransition)) : 0.0) +
            (astern > 0 ? std::max(0.0, astern * signed_root(pressure - node_b, kTransition)) : 0.0);
    pressure = 0.5 * (pressure + supply_port_.boundary(measured, drawn, time));
  }
  return pressure;
}

void ServoActuator::derivative(double time, const double* state, const double* channels, double* rate) {
  const double velocity = state[kVelocity];
  const double p_a = state[kPressureA], p_b = state[kPressureB];
  const double node_a = has_line_ ? state[line_] : p_a;
  const double node_b = has_line_ ? state[line_ + 1] : p_b;
  const double supply_pressure = has_droop_ ? drooped(time, state, channels[supply_]) : channels[supply_];

  const double ahead = root_coefficient_ * valve_port_.edge(state[kSpool]);    // P to A, B to tank
  const double astern = root_coefficient_ * valve_port_.edge(-state[kSpool]);  // P to B, A to tank
  double q_a = 0, q_b = 0;
  if (ahead > 0) {
    q_a = ahead * signed_root(supply_pressure - node_a, kTransition);
    q_b = ahead * signed_root(node_b, kTransition);
  }
  if (astern > 0) {
    q_a -= astern * signed_root(node_a, kTransition);
    q_b -= astern * signed_root(supply_pressure - node_b, kTransition);
  }

  const double drop = p_a - p_b;
  const double bypass = state[kLeakSpool] > 0 ? leak_gain_ * state[kLeakSpool] * signed_root(drop, kTransition) : 0.0;
  const double leak = bypass + leak_port_.flow({drop, p_a, 0});
  const double to_tank_a = leak_a_port_.flow({p_a, p_a, 0});
  const double to_tank_b = leak_b_port_.flow({p_b, p_b, 0});

  const double beta_a = compliance_port_.bulk_modulus(bulk_modulus_, p_a + kAtmosphere);
  const double beta_b = compliance_port_.bulk_modulus(bulk_modulus_, p_b + kAtmosphere);
  const double at_node = has_line_ ? kValveNodeShare * chamber_volume_ : 0.0;
  const double volume_a = chamber_volume_ + area_ * state[kPosition] - at_node;
  const double volume_b = chamber_volume_ - area_ * state[kPosition] - at_node;
  const double in_a = has_line_ ? state[line_ + 2] : q_a;
  const double out_b = has_line_ ? state[line_ + 3] : q_b;
  rate[kPressureA] = beta_a / volume_a * (in_a - area_ * velocity - leak - to_tank_a);
  rate[kPressureB] = beta_b / volume_b * (area_ * velocity - out_b + leak - to_tank_b);
  // Make-up valves hold the chambers at tank pressure.
  if (p_a <= 0 && rate[kPressureA] < 0) rate[kPressureA] = 0;
  if (p_b <= 0 && rate[kPressureB] < 0) rate[kPressureB] = 0;

  if (has_line_) {
    const double inertance = std::max(line_port_.line().inertance, kSmallestInertance);
    const double node_beta_a = compliance_port_.bulk_modulus(bulk_modulus_, node_a + kAtmosphere);
    const double node_beta_b = compliance_port_.bulk_modulus(bulk_modulus_, node_b + kAtmosphere);
    rate[line_] = node_beta_a / at_node * (q_a - state[line_ + 2]);
    rate[line_ + 1] = node_beta_b / at_node * (state[line_ + 3] - q_b);
    rate[line_ + 2] = (node_a - p_a) / inertance;
    rate[line_ + 3] = (p_b - node_b) / inertance;
    if (node_a <= 0 && rate[line_] < 0) rate[line_] = 0;
    if (node_b <= 0 && rate[line_ + 1] < 0) rate[line_ + 1] = 0;
  }

  rate[kPosition] = velocity;
  const double coupling = has_load_ ? coupling_force(state) : channels[load_force_];
  rate[kVelocity] = piston_friction_.stuck() ? 0 : acceleration(state, coupling);
  if (has_load_) {
    const Body other = load(state, coupling, channels);
    rate[load_] = state[load_ + 1];
    rate[load_ + 1] = load_friction_.stuck()
                          ? 0
                          : (other.force - load_friction_.force(other.sliding_plus, other.sliding_minus)) / other.mass;
  }

  rate[kSpool] = (spool_gain_ * channels[command_] - state[kSpool]) * spool_rate_;
  rate[kLeakSpool] = (channels[leak_command_] - state[kLeakSpool]) * leak_rate_;
  rate[kMeter] = (std::abs(bypass) - state[kMeter]) * meter_rate_;
}

void ServoActuator::after_step(double, double* state, const double* channels) {
  state[kPressureA] = std::max(0.0, state[kPressureA]);
  state[kPressureB] = std::max(0.0, state[kPressureB]);
  state[kSpool] = std::clamp(state[kSpool], -kSpoolLimit, kSpoolLimit);
  if (has_line_) {
    state[line_] = std::max(0.0, state[line_]);
    state[line_ + 1] = std::max(0.0, state[line_ + 1]);
  }
  if (!piston_friction_.slips_on(state[kVelocity])) {
    const Body body = piston(state, has_load_ ? coupling_force(state) : channels[load_force_]);
    piston_friction_.after_step(state[kVelocity], body.force, body.breakaway_plus, body.breakaway_minus);
  }
  if (has_load_ && !load_friction_.slips_on(state[load_ + 1])) {
    const Body other = load(state, coupling_force(state), channels);
    load_friction_.after_step(state[load_ + 1], other.force, other.breakaway_plus, other.breakaway_minus);
  }
}

void ServoActuator::outputs(double, const double* state, double* channels) const {
  channels[out_position_] = state[kPosition];
  channels[out_velocity_] = state[kVelocity];
  channels[out_pressure_] = state[kPressureA] - state[kPressureB];
  channels[out_a_] = state[kPressureA];
  channels[out_b_] = state[kPressureB];
  channels[out_spool_] = state[kSpool];
  channels[out_leak_flow_] = state[kMeter];
}

namespace {
FAULTLINE_RIG(servo_actuator, {"servo_actuator", 0.25e-3, make_rig<ServoActuator>, 0.5e-3, 1e-3});
}

}  // namespace faultline
