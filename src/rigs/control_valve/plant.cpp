#include "rigs/control_valve/plant.h"

#include <algorithm>
#include <cmath>

namespace faultline {
namespace {

enum { kFlapper, kPrestage, kSpool, kCylinder, kPiston, kTorque, kPlay, kTwist };

constexpr double kHalfTurn = kPi / 2;  // rad, from closed to open
constexpr double kPerHalfTurn = 1 / kHalfTurn;
constexpr double kGaugeFloor = -1e5;         // Pa
constexpr double kSlowestJoint = 1e-3;       // s, of compliance and damping of the joint; faster ones are at rest
constexpr double kSmallestJointDamping = 2;  // N m s/rad; less is faster than the integration step with the seal
constexpr double kLeastGive = 0.1;           // of the shaft behind the joint, so that a division stays bounded
constexpr double kSure = 4;                  // noises of a torque that says so wherever the load stood
constexpr double kNearFlank = 1e-5;          // m, at which a measured torque says that the play is used up

bool damped(const Coupling& joint) {
  return joint.damping >= kSmallestJointDamping && joint.compliance * joint.damping >= kSlowestJoint;
}

}  // namespace

ControlValve::ControlValve(const Datasheet& sheet, const std::vector<double>& parameters, const EffectSet& effects)
    : nozzle_flapper_(ValveFacts{sheet, parameters, effects}),
      spool_valve_(ValveFacts{sheet, parameters, effects}),
      actuator_(ValveFacts{sheet, parameters, effects}),
      process_valve_(ValveFacts{sheet, parameters, effects}),
      linkage_port_(effects.at("transmission.linkage")),
      linked_(!linkage_port_.empty()),
      gas_constant_(ValveFacts{sheet, parameters, effects}.constant("gas_constant")),
      ambient_(ValveFacts{sheet, parameters, effects}.constant("atmospheric_pressure")) {
  check_state_names(sheet, {"flapper", "prestage", "spool", "cylinder", "piston", "seal_torque"});
  voltage_ = sheet.channel("coil_voltage");
  supply_ = sheet.channel("supply_pressure");
  temperature_ = sheet.channel("ambient_temperature");
  flow_setpoint_ = sheet.channel("flow_setpoint");
  valve_setpoint_ = sheet.channel("valve_setpoint");
  out_flapper_ = sheet.channel("flapper_position");
  out_prestage_ = sheet.channel("prestage_pressure");
  out_spool_ = sheet.channel("spool_position");
  out_cylinder_ = sheet.channel("cylinder_pressure");
  out_torque_ = sheet.channel("load_torque");
  sure_torque_ = kSure * sheet.channels[static_cast<std::size_t>(out_torque_)].noise_std;
  out_position_ = sheet.channel("valve_position");
  out_flow_ = sheet.channel("flow");
  out_prestage_flow_ = find_channel(sheet.channels, "prestage_net_mass_flow");
  out_cylinder_flow_ = find_channel(sheet.channels, "cylinder_net_mass_flow");
}

void ControlValve::start(const double* channels, double* state) {
  double opening = 0.5;
  if (channels[flow_setpoint_] > 0)
    opening = process_valve_.opening_of(channels[flow_setpoint_]);
  else if (channels[valve_setpoint_] > 0)
    opening = channels[valve_setpoint_];
  double nominal[kValveStates] = {};
  nominal[kFlapper] = nozzle_flapper_.rest() / 2;
  nominal[kSpool] = 0.5;
  nominal[kPrestage] = spool_valve_.balance(channels[supply_]);
  nominal[kPiston] = opening;
  nominal[kCylinder] = actuator_.rest_pressure(actuator_.travel(opening));
  start_at(nominal, channels, state);
  actuator_.stick();
  set_modes(state);
  last_ = mass_flows(0, state, channels);
}

void ControlValve::start_at(const double* nominal_state, const double*, double* state) {
  std::copy_n(nominal_state, kValveStates, state);
  if (linked_) state[kPlay] = state[kTwist] = 0;
}

void ControlValve::set_modes(const double* state) {
  std::copy_n(state, kValveStates, before_.begin());
  if (!linked_) return;
  const double half = linkage_port_.coupling().gap / 2;
  contact_ = 0;
  const bool near_flank = state[kTorque] != 0 && std::abs(state[kPlay]) >= half - kNearFlank;
  if (near_flank || std::abs(state[kTorque]) > sure_torque_) contact_ = state[kTorque] > 0 ? 1 : -1;
}

int ControlValve::motion(const double* state) const {
  return linked_ || actuator_.may_slip(state[kPiston]) ? kUneven : 0;
}

double ControlValve::twist(const double* state, double torque) const {
  const Coupling joint = linkage_port_.coupling();
  return damped(joint) ? state[kTwist] : joint.compliance * torque;
}

inline ControlValve::MassFlows ControlValve::mass_flows(double time, const double* state,
                                                        const double* channels) const {
  if (channels[temperature_] != root_at_) {
    root_at_ = channels[temperature_];
    root_ = std::sqrt(2 / (gas_constant_ * root_at_));
  }
  const double root = root_;
  const double prestage = state[kPrestage] + ambient_, cylinder = state[kCylinder] + ambient_;
  MassFlows flows;
  flows.supply = spool_valve_.supply(time, state[kSpool], cylinder, channels[supply_], root);
  const double supply = flows.supply + ambient_;
  flows.prestage = nozzle_flapper_.net_flow(state[kFlapper], prestage, supply, root);
  flows.prestage_leak = nozzle_flapper_.leak(prestage, root);
  flows.cylinder = spool_valve_.flow(state[kSpool], cylinder, supply, root);
  flows.cylinder_leak = actuator_.leak(cylinder, root);
  return flows;
}

void ControlValve::pass_joint(const double* state, Shaft& shaft) const {
  const double driven = shaft.piston - state[kPlay];
  if (contact_ == 0) shaft.torque = 0;
  shaft.opening = (actuator_.angle(driven) - twist(state, shaft.torque)) * kPerHalfTurn;
  shaft.ratio = actuator_.ratio(driven);
}

inline ControlValve::Shaft ControlValve::shaft(const double* state) const {
  Shaft shaft;
  const Actuator::Lever lever = actuator_.lever(state[kPiston]);
  shaft.piston = lever.travel;
  shaft.torque = state[kTorque];
  shaft.opening = state[kPiston];
  shaft.ratio = lever.ratio;
  if (linked_) pass_joint(state, shaft);
  shaft.seal = process_valve_.seal(shaft.opening);
  return shaft;
}

void ControlValve::derivative(double time, const double* state, const double* channels, double* rate) {
  const MassFlows flows = mass_flows(time, state, channels);
  const double heat = gas_constant_ * channels[temperature_];
  rate[kFlapper] = nozzle_flapper_.speed(state[kFlapper], state[kPrestage], channels[voltage_], channels[temperature_]);

  const double spooling = spool_valve_.speed(state[kSpool], state[kPrestage], flows.supply);
  rate[kSpool] = spooling * spool_valve_.per_stroke();
  rate[kPrestage] = spool_valve_.prestage_rate(state[kSpool], spooling, state[kPrestage] + ambient_,
                                               flows.prestage - flows.prestage_leak, heat);

  const Shaft now = shaft(state);
  const double speed = actuator_.speed(now.piston, state[kCylinder], now.load());
  rate[kPiston] = speed * (linked_ ? actuator_.ratio(now.piston) : now.ratio) * kPerHalfTurn;
  rate[kCylinder] = actuator_.cylinder_rate(now.piston, speed, state[kCylinder] + ambient_,
                                            flows.cylinder - flows.cylinder_leak, heat);

  const double turning = turn(now, speed, rate, state);
  const double reach = turning > 0 ? now.seal.plus - now.torque : now.seal.minus + now.torque;
  rate[kTorque] = turning * reach * process_valve_.per_windup();
}

// Speed of the shaft behind the linkage, rad/s, and the rates of the linkage's states.
inline double ControlValve::turn(const Shaft& now, double speed, double* rate, const double* state) const {
  const double turning = now.ratio * speed;  // of the joint's driven side
  if (!linked_) return turning;
  const Coupling joint = linkage_port_.coupling();
  const bool slow = damped(joint);
  rate[kTwist] = slow ? (joint.compliance * now.torque - state[kTwist]) / (joint.compliance * joint.damping) : 0;
  rate[kPlay] = contact_ == 0 ? speed - rate[kTwist] / now.ratio : 0;
  if (contact_ == 0) return 0;
  if (slow) return turning - rate[kTwist];
  if (joint.compliance <= 0) return turning;
  const double reach = turning > 0 ? now.seal.plus - now.torque : now.seal.minus + now.torque;
  return turning / std::max(1 + joint.compliance * reach / process_valve_.windup(), kLeastGive);
}

void ControlValve::follow_play(double* state) {
  const Coupling joint = linkage_port_.coupling();
  const double half = joint.gap / 2;
  if (contact_ != 0 && contact_ * state[kTorque] > 0) {
    state[kPlay] = contact_ * half;  // also where the gap has grown
    return;
  }
  // The step went past the flank: what it went too far is a way in the play, or a torque.
  const Shaft now = shaft(state);
  const double give = process_valve_.windup() / now.ratio;  // m of travel per unit of torque over T_c
  if (contact_ != 0) {
    state[kPlay] = contact_ * half + give * state[kTorque] / (contact_ > 0 ? now.seal.plus : now.seal.minus);
    state[kTorque] = 0;
    contact_ = 0;
  }
  if (std::abs(state[kPlay]) > half) {
    contact_ = state[kPlay] > 0 ? 1 : -1;
    const double level = contact_ > 0 ? now.seal.plus : now.seal.minus;
    state[kTorque] = std::clamp((state[kPlay] - contact_ * half) / give, -1.0, 1.0) * level;
    state[kPlay] = contact_ * half;
  }
}

// Without mass a body reaches its stop at any speed, and a step may end far beyond. What the gas behind it did on the
// way beyond is undone, at the rate at which the step began; so is that way in the play. What winds the seal up is the
// way to the stop, dT_v/dphi of (11).
void ControlValve::stop_bodies(double* state) const {
  const double spool = std::clamp(state[kSpool], 0.0, 1.0), piston = std::clamp(state[kPiston], 0.0, 1.0);
  if (spool != state[kSpool])
    state[kPrestage] -=
        spool_valve_.pressure_rise(before_[kSpool], before_[kPrestage] + ambient_, state[kSpool] - spool);
  if (piston != state[kPiston]) {
    const double beyond = (state[kPiston] - piston) * kHalfTurn / actuator_.lever(piston).ratio;
    state[kCylinder] -=
        actuator_.pressure_rise(actuator_.travel(before_[kPiston]), before_[kCylinder] + ambient_, beyond);
    if (linked_ && contact_ == 0) {
      state[kPlay] -= beyond;
    } else {
      const double way = (piston - before_[kPiston]) * kHalfTurn;
      const ProcessValve::Seal seal = process_valve_.seal(piston);
      const double level = piston >= 1 ? seal.plus : -seal.minus;
      state[kTorque] = level + (before_[kTorque] - level) * std::exp(-std::abs(way) * process_valve_.per_windup());
    }
  }
  state[kSpool] = spool;
  state[kPiston] = piston;
}

void ControlValve::after_step(double time, double* state, const double* channels) {
  state[kFlapper] = std::clamp(state[kFlapper], 0.0, nozzle_flapper_.limit());
  stop_bodies(state);
  state[kPrestage] = std::max(state[kPrestage], kGaugeFloor);
  state[kCylinder] = std::max(state[kCylinder], kGaugeFloor);
  if (linked_) follow_play(state);
  if (actuator_.may_slip(state[kPiston])) {
    const Shaft now = shaft(state);
    actuator_.follow_slip(now.piston, state[kCylinder], now.load());
  }
  std::copy_n(state, kValveStates, before_.begin());
  if (out_prestage_flow_ >= 0 || out_cylinder_flow_ >= 0) last_ = mass_flows(time, state, channels);
}

void ControlValve::outputs(double, const double* state, double* channels) const {
  const Shaft now = shaft(state);
  channels[out_flapper_] = state[kFlapper];
  channels[out_prestage_] = state[kPrestage];
  channels[out_spool_] = state[kSpool];
  channels[out_cylinder_] = state[kCylinder];
  channels[out_torque_] = now.torque;
  channels[out_position_] = now.opening;
  channels[out_flow_] = process_valve_.flow(now.opening);
  if (out_prestage_flow_ >= 0) channels[out_prestage_flow_] = last_.prestage;
  if (out_cylinder_flow_ >= 0) channels[out_cylinder_flow_] = last_.cylinder;
}

namespace {
// Nothing in the linkage has a mass: only what damps a compliance is fast.
bool is_fast(const EffectSpec& effect) { return effect.effect == "elasticity"; }
FAULTLINE_RIG(control_valve, {"control_valve", 0.5e-3, make_rig<ControlValve>, 1.25e-3, 2.5e-3, 0, is_fast});
}  // namespace

}  // namespace faultline
