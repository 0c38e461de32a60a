#include "rigs/control_valve/plant.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "faultline/rig/orifice.h"
#include "faultline/signal/error.h"
#include "rigs/control_valve/air_flow.h"

namespace faultline {
namespace {

enum { kFlapper, kPrestage, kSpool, kCylinder, kPiston, kTorque, kNominalStates, kPlay = kNominalStates, kTwist };

constexpr double kPi = 3.14159265358979323846;
constexpr double kHalfTurn = kPi / 2;        // rad, from closed to open
constexpr double kEffectiveRing = 0.4125;    // share of the nozzle's rim that the pressure acts on, (15)
constexpr double kLeakTransition = 1000;     // Pa, of the leakage effects, so that their coefficient comes out
constexpr double kGaugeFloor = -1e5;         // Pa
constexpr double kFast = 1e3;                // m/s, at which friction that falls with speed has fallen
constexpr double kSlowestJoint = 1e-3;       // s, of compliance and damping of the joint; faster ones are at rest
constexpr double kSmallestJointDamping = 2;  // N m s/rad; less is faster than the integration step with the seal
constexpr double kLeastGive = 0.1;           // of the shaft behind the joint, so that a division stays bounded
constexpr double kNearFlank = 1e-5;          // m, at which a measured torque says that the play is used up
constexpr int kMostSteps = 40;
const double kFlowUnits = 0.865 / 3600;  // C_v in gpm/psi^0.5 and bar to m^3/s

double outside(double force, double low, double high) {
  return force > high ? force - high : force < low ? force - low : 0;
}

// A body at a stop does not move outwards.
double within(double speed, double position, double low, double high) {
  return (position <= low && speed < 0) || (position >= high && speed > 0) ? 0 : speed;
}

}  // namespace

ControlValve::ControlValve(const Datasheet& sheet, const std::vector<double>& parameters, const EffectSet& effects)
    : spool_port_(effects.at("force.spool")),
      actuator_port_(effects.at("force.actuator")),
      seal_port_(effects.at("force.valve")),
      prestage_leak_(effects.at("flow.prestage_ambient")),
      cylinder_leak_(effects.at("flow.cylinder_ambient")),
      restrictor_port_(effects.at("restriction.fixed_restrictor")),
      nozzle_port_(effects.at("restriction.nozzle")),
      spool_ports_(effects.at("restriction.spool_ports")),
      process_port_(effects.at("restriction.process_valve")),
      cylinder_port_(effects.at("compliance.cylinder")),
      linkage_port_(effects.at("transmission.linkage")),
      supply_port_(effects.at("source.supply")),
      linked_(!linkage_port_.empty()),
      nozzle_cd_(sheet, "nozzle_cd", "x_m", "value"),
      fill_low_(sheet, "fill_cd", "pressure_ratio", "s_0.6"),
      fill_high_(sheet, "fill_cd", "pressure_ratio", "s_0.8_and_1"),
      exhaust_0_(sheet, "exhaust_cd", "p_c_Pa", "s_0"),
      exhaust_2_(sheet, "exhaust_cd", "p_c_Pa", "s_0.2"),
      exhaust_4_(sheet, "exhaust_cd", "p_c_Pa", "s_0.4"),
      coulomb_plus_(sheet, "coulomb_pos", "x_m", "value_N"),
      coulomb_minus_(sheet, "coulomb_neg", "x_m", "value_N"),
      seal_mu_(sheet, "seal_mu", "h", "value") {
  check_state_names(sheet, {"flapper", "prestage", "spool", "cylinder", "piston", "seal_torque"});
  const auto constant = [&](const char* name) {
    const auto found = sheet.constants.find(name);
    if (found == sheet.constants.end())
      throw InputError(
          fmt::format("{}: 'constants' lacks '{}', which the equations of {} ask for", sheet.file, name, sheet.rig));
    return found->second;
  };
  gamma_ = constant("gamma");
  gas_constant_ = constant("gas_constant");
  ambient_ = constant("atmospheric_pressure");
  stroke_ = constant("stroke");
  seal_lever_ = constant("seal_lever");
  flapper_limit_ = constant("flapper_limit");
  coil_reference_ = constant("coil_reference_temperature");
  leak_area_ = std::sqrt(constant("leakage_density") / 2);

  const auto value = [&](const char* name) { return parameters[static_cast<std::size_t>(sheet.parameter(name))]; };
  nozzle_diameter_ = value("nozzle_inner_diameter");
  const double effective = nozzle_diameter_ + kEffectiveRing * (value("nozzle_outer_diameter") - nozzle_diameter_);
  pressure_area_ = kPi / 4 * effective * effective;
  restrictor_area_ = value("restrictor_cd") * kPi / 4 * std::pow(value("restrictor_diameter"), 2);
  nozzle_factor_ = value("nozzle_cd_factor");
  flapper_spring_ = value("flapper_spring");
  flapper_damping_ = value("flapper_damping");
  flapper_rest_ = value("flapper_rest");
  coil_factor_ = value("coil_force_factor");
  coil_temperature_ = value("coil_temp_coef");
  pressure_0_ = value("pressure_coef_0");
  pressure_1_ = value("pressure_coef_1");
  prestage_volume_ = value("prestage_volume");
  prestage_area_ = value("prestage_area");
  supply_area_ = value("supply_area");
  spool_stroke_ = value("spool_stroke");
  spool_spring_ = value("spool_spring");
  spool_pretension_ = value("spool_pretension");
  diaphragm_ = value("diaphragm_stiffness");
  spool_viscous_ = value("spool_viscous");
  spool_coulomb_ = value("spool_coulomb");
  port_area_ = value("port_area");
  fill_factor_ = value("fill_cd_factor");
  exhaust_factor_ = value("exhaust_cd_factor");
  cylinder_area_ = value("cylinder_area");
  dead_volume_ = value("dead_volume");
  spring_rate_ = value("spring_rate");
  spring_pretension_ = value("spring_pretension");
  actuator_viscous_ = value("actuator_viscous");
  plus_factor_ = value("coulomb_pos_factor");
  minus_factor_ = value("coulomb_neg_factor");
  seal_torque_ = value("seal_friction_factor") * value("seal_force") * seal_lever_;
  windup_ = value("windup_angle");
  capacity_ = value("valve_cv");
  linear_share_ = value("valve_cv_linear");
  pump_pressure_ = value("pump_pressure");
  open_ratio_ = value("open_pressure_ratio");
  crank_ = stroke_ / std::sqrt(2.0);

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
  out_position_ = sheet.channel("valve_position");
  out_flow_ = sheet.channel("flow");
  out_prestage_flow_ = find_channel(sheet.channels, "prestage_net_mass_flow");
  out_cylinder_flow_ = find_channel(sheet.channels, "cylinder_net_mass_flow");
}

void ControlValve::start(const double* channels, double* state) {
  double opening = 0.5;
  if (channels[flow_setpoint_] > 0) {
    double low = 0, high = 1;
    for (int i = 0; i < kMostSteps; ++i) {
      opening = 0.5 * (low + high);
      (flow(opening) < channels[flow_setpoint_] ? low : high) = opening;
    }
  } else if (channels[valve_setpoint_] > 0) {
    opening = channels[valve_setpoint_];
  }
  double nominal[kNominalStates] = {};
  nominal[kFlapper] = flapper_rest_ / 2;
  nominal[kSpool] = 0.5;
  nominal[kPrestage] = (supply_area_ * channels[supply_] + spool_spring_ * (spool_stroke_ / 2 + spool_pretension_) +
                        diaphragm_ * spool_stroke_ / 2) /
                       prestage_area_;
  nominal[kPiston] = opening;
  nominal[kCylinder] = spring_rate_ * (travel(opening) + spring_pretension_) / cylinder_area_;
  start_at(nominal, channels, state);
  slip_ = 0;
  set_modes(state);
  last_ = mass_flows(0, state, channels);
}

void ControlValve::start_at(const double* nominal_state, const double*, double* state) {
  std::copy_n(nominal_state, kNominalStates, state);
  if (linked_) state[kPlay] = state[kTwist] = 0;
}

void ControlValve::set_modes(const double* state) {
  if (!linked_) return;
  const double half = linkage_port_.coupling().gap / 2;
  contact_ = 0;
  if (state[kTorque] != 0 && std::abs(state[kPlay]) >= half - kNearFlank) contact_ = state[kTorque] > 0 ? 1 : -1;
}

double ControlValve::travel(double opening) const {
  return stroke_ / 2 + crank_ * std::sin(opening * kHalfTurn - kPi / 4);
}

double ControlValve::angle(double travel) const {
  return kPi / 4 + std::asin(std::clamp((travel - stroke_ / 2) / crank_, -1.0, 1.0));
}

double ControlValve::ratio(double travel) const {
  const double lever = travel - stroke_ / 2;
  return 1 / std::sqrt(std::max(crank_ * crank_ - lever * lever, 0.01 * crank_ * crank_));
}

double ControlValve::twist(const double* state, double torque) const {
  const Coupling joint = linkage_port_.coupling();
  const bool slow = joint.damping >= kSmallestJointDamping && joint.compliance * joint.damping >= kSlowestJoint;
  return slow ? state[kTwist] : joint.compliance * torque;
}

double ControlValve::relative_opening(double opening) const {
  double h = std::max(opening, 0.0), share = 1;
  if (!process_port_.empty()) {
    // The port's effects act at two places: what they leave of a full opening scales c, the rest bends h.
    share = process_port_.opening(1);
    h = share > 0 ? process_port_.opening(h) / share : h;
  }
  return share * (linear_share_ * h + (1 - linear_share_) * h * h * h);
}

double ControlValve::pressure_drop(double opening) const {
  const double c = relative_opening(opening);
  return pump_pressure_ * open_ratio_ / (open_ratio_ + (1 - open_ratio_) * c * c);
}

double ControlValve::flow(double opening) const {
  return kFlowUnits * capacity_ * relative_opening(opening) * std::sqrt(pressure_drop(opening) / 1e5);
}

double ControlValve::leak(const EffectChain& port, double pressure, double root) const {
  if (port.empty()) return 0;
  const double drop = std::max(pressure - ambient_, 1.0);
  const double coefficient = port.flow({drop, drop, 0}) / signed_root(drop, kLeakTransition);
  return air_flow(coefficient * leak_area_, pressure, ambient_, root);
}

double ControlValve::spool_flow(double spool, double cylinder, double supply, double root) const {
  double opening = spool - 0.5;
  if (!spool_ports_.empty()) opening = spool_ports_.opening(opening);
  if (opening > 0) {
    const double ratio = cylinder / supply, low = fill_low_(ratio);
    const double cd = low + (fill_high_(ratio) - low) * std::clamp((spool - 0.6) / 0.2, 0.0, 1.0);
    return air_flow(fill_factor_ * cd * port_area_ * opening / 0.5, supply, cylinder, root);
  }
  const double gauge = cylinder - ambient_, middle = exhaust_2_(gauge);
  const double cd = spool < 0.2 ? middle + (exhaust_0_(gauge) - middle) * std::min((0.2 - spool) / 0.2, 1.0)
                                : middle + (exhaust_4_(gauge) - middle) * std::min((spool - 0.2) / 0.2, 1.0);
  return -air_flow(exhaust_factor_ * cd * port_area_ * -opening / 0.5, cylinder, ambient_, root);
}

ControlValve::MassFlows ControlValve::mass_flows(double time, const double* state, const double* channels) const {
  const double root = std::sqrt(2 / (gas_constant_ * channels[temperature_]));
  const double prestage = state[kPrestage] + ambient_, cylinder = state[kCylinder] + ambient_;
  const double spool = state[kSpool];
  MassFlows flows;
  flows.supply = channels[supply_];
  if (!supply_port_.empty()) {
    // The filling flow lowers the pressure that drives it: p - boundary(m(p)) rises with p, between what all of the
    // flow at the undisturbed pressure leaves and that pressure.
    const auto left = [&](double supply) {
      const double filling = std::max(0.0, spool_flow(spool, cylinder, supply + ambient_, root));
      return supply_port_.boundary(channels[supply_], filling, time);
    };
    double high = supply_port_.boundary(channels[supply_], 0, time), low = left(high);
    for (int i = 0; i < kMostSteps && high - low > 1; ++i) {
      const double middle = 0.5 * (low + high);
      const double end = left(middle);
      if (middle > end) {
        high = middle;
        low = std::max(low, end);
      } else {
        low = middle;
        high = std::min(high, end);
      }
    }
    flows.supply = 0.5 * (low + high);
  }
  const double supply = flows.supply + ambient_;
  const double gap = std::max(state[kFlapper], 0.0);
  const double in = restrictor_port_.opening(restrictor_area_);
  const double out = nozzle_port_.opening(nozzle_factor_ * nozzle_cd_(gap) * kPi * nozzle_diameter_ * gap);
  flows.prestage = air_flow(in, supply, prestage, root) - air_flow(out, prestage, ambient_, root);
  flows.prestage_leak = leak(prestage_leak_, prestage, root);
  flows.cylinder = spool_flow(spool, cylinder, supply, root);
  flows.cylinder_leak = leak(cylinder_leak_, cylinder, root);
  return flows;
}

double ControlValve::spool_speed(const double* state, double supply) const {
  const double position = state[kSpool] * spool_stroke_;
  double force = prestage_area_ * state[kPrestage] - supply_area_ * supply -
                 spool_spring_ * (position + spool_pretension_) - diaphragm_ * position;
  double plus = spool_coulomb_, minus = spool_coulomb_;
  if (!spool_port_.empty()) {
    const BodyForces extra = spool_port_.forces({position - spool_stroke_ / 2, 0, 0});
    force -= extra.applied;
    plus += extra.sliding_plus;
    minus += extra.sliding_minus;
  }
  return within(outside(force, -minus, plus) / spool_viscous_, position, 0, spool_stroke_);
}

ControlValve::Shaft ControlValve::shaft(const double* state) const {
  Shaft shaft;
  shaft.piston = travel(state[kPiston]);
  shaft.torque = state[kTorque];
  shaft.opening = state[kPiston];
  double driven = shaft.piston;
  if (linked_) {
    driven -= state[kPlay];
    if (contact_ == 0) shaft.torque = 0;
    shaft.opening = (angle(driven) - twist(state, shaft.torque)) / kHalfTurn;
  }
  shaft.ratio = ratio(driven);
  shaft.plus = shaft.minus = seal_torque_ * seal_mu_(shaft.opening);
  if (!seal_port_.empty()) {
    const BodyForces extra = seal_port_.forces({shaft.opening * kHalfTurn, 0, pressure_drop(shaft.opening)});
    shaft.plus += extra.sliding_plus;
    shaft.minus += extra.sliding_minus;
  }
  return shaft;
}

double ControlValve::piston_force(const double* state, const Shaft& shaft) const {
  const double position = shaft.piston;
  double force =
      cylinder_area_ * state[kCylinder] - spring_rate_ * (position + spring_pretension_) - shaft.torque * shaft.ratio;
  if (!actuator_port_.empty()) force -= actuator_port_.forces({position - stroke_ / 2, 0, 0}).applied;
  return force;
}

double ControlValve::piston_speed(const double* state, const Shaft& shaft) const {
  const double position = shaft.piston, force = piston_force(state, shaft);
  Band band;
  band.plus = plus_factor_ * coulomb_plus_(position);
  band.minus = minus_factor_ * coulomb_minus_(position);
  band.viscous = actuator_viscous_;
  double speed = 0;
  if (actuator_port_.empty())
    speed = outside(force, -band.minus, band.plus) / band.viscous;
  else
    speed = slip_speed(position, force, band);
  return within(speed, position, 0, stroke_);
}

// Friction may fall with speed: then it has two levels, at rest and when fast.
double ControlValve::slip_speed(double position, double force, const Band& band) const {
  const double at = position - stroke_ / 2;
  const BodyForces fast = actuator_port_.forces({at, kFast, 0}), rest = actuator_port_.forces({at, 0, 0});
  const double viscous = band.viscous + fast.viscous / kFast;
  const double plus = band.plus + fast.sliding_plus, minus = band.minus + fast.sliding_minus;
  if (rest.breakaway_plus <= fast.sliding_plus && rest.breakaway_minus <= fast.sliding_minus)
    return outside(force, -minus, plus) / viscous;
  if (slip_ == 0) return 0;
  // From above, b v + level(v) = |F|: the iteration falls to the highest speed in balance, or to rest where there is
  // none.
  double speed = std::max(0.0, slip_ * outside(force, -minus, plus) / viscous);
  for (int i = 0; i < kMostSteps && speed > 0; ++i) {
    const BodyForces now = actuator_port_.forces({at, slip_ * speed, 0});
    const double level = slip_ > 0 ? band.plus + now.sliding_plus : band.minus + now.sliding_minus;
    const double next = std::max(0.0, (slip_ * force - level) / viscous);
    if (speed - next <= 1e-6 * speed) break;
    speed = next;
  }
  return slip_ * speed;
}

void ControlValve::derivative(double time, const double* state, const double* channels, double* rate) {
  const MassFlows flows = mass_flows(time, state, channels);
  const double heat = gas_constant_ * channels[temperature_];

  const double coil =
      channels[voltage_] * coil_factor_ * ((channels[temperature_] - coil_reference_) * coil_temperature_ + 1);
  const double gap = state[kFlapper];
  const double pressed = std::max(0.0, pressure_0_ - pressure_1_ * gap) * state[kPrestage] * pressure_area_;
  rate[kFlapper] =
      within((pressed - coil - flapper_spring_ * (gap - flapper_rest_)) / flapper_damping_, gap, 0, flapper_limit_);

  const double spooling = spool_speed(state, flows.supply);
  rate[kSpool] = spooling / spool_stroke_;
  rate[kPrestage] =
      gamma_ / (prestage_volume_ + prestage_area_ * state[kSpool] * spool_stroke_) *
      ((flows.prestage - flows.prestage_leak) * heat - (state[kPrestage] + ambient_) * prestage_area_ * spooling);

  const Shaft now = shaft(state);
  const double speed = piston_speed(state, now);
  rate[kPiston] = speed * ratio(now.piston) / kHalfTurn;
  rate[kCylinder] =
      gamma_ / (dead_volume_ + cylinder_area_ * now.piston) *
      ((flows.cylinder - flows.cylinder_leak) * heat - (state[kCylinder] + ambient_) * cylinder_area_ * speed);
  if (!cylinder_port_.empty()) rate[kCylinder] *= cylinder_port_.bulk_modulus(1, state[kCylinder] + ambient_);

  double turning = now.ratio * speed;  // rad/s, of the joint's driven side
  if (linked_) {
    const Coupling joint = linkage_port_.coupling();
    const bool slow = joint.damping >= kSmallestJointDamping && joint.compliance * joint.damping >= kSlowestJoint;
    rate[kTwist] = slow ? (joint.compliance * now.torque - state[kTwist]) / (joint.compliance * joint.damping) : 0;
    rate[kPlay] = contact_ == 0 ? speed - rate[kTwist] / now.ratio : 0;
    if (contact_ == 0)
      turning = 0;
    else if (slow)
      turning -= rate[kTwist];
    else if (joint.compliance > 0) {
      const double reach = turning > 0 ? now.plus - now.torque : now.minus + now.torque;
      turning /= std::max(1 + joint.compliance * reach / windup_, kLeastGive);
    }
  }
  rate[kTorque] =
      turning > 0 ? turning * (now.plus - now.torque) / windup_ : turning * (now.minus + now.torque) / windup_;
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
  const double give = windup_ / now.ratio;  // m of travel per unit of torque over T_c
  if (contact_ != 0) {
    state[kPlay] = contact_ * half + give * state[kTorque] / (contact_ > 0 ? now.plus : now.minus);
    state[kTorque] = 0;
    contact_ = 0;
  }
  if (std::abs(state[kPlay]) > half) {
    contact_ = state[kPlay] > 0 ? 1 : -1;
    const double level = contact_ > 0 ? now.plus : now.minus;
    state[kTorque] = std::clamp((state[kPlay] - contact_ * half) / give, -1.0, 1.0) * level;
    state[kPlay] = contact_ * half;
  }
}

void ControlValve::after_step(double time, double* state, const double* channels) {
  state[kFlapper] = std::clamp(state[kFlapper], 0.0, flapper_limit_);
  state[kSpool] = std::clamp(state[kSpool], 0.0, 1.0);
  state[kPiston] = std::clamp(state[kPiston], 0.0, 1.0);
  state[kPrestage] = std::max(state[kPrestage], kGaugeFloor);
  state[kCylinder] = std::max(state[kCylinder], kGaugeFloor);
  if (linked_) follow_play(state);
  if (!actuator_port_.empty()) {
    const Shaft now = shaft(state);
    if (slip_ != 0 && piston_speed(state, now) == 0) slip_ = 0;
    const double position = now.piston, force = piston_force(state, now);
    const BodyForces extra = actuator_port_.forces({position - stroke_ / 2, 0, 0});
    if (slip_ == 0 && force > plus_factor_ * coulomb_plus_(position) + extra.breakaway_plus) slip_ = 1;
    if (slip_ == 0 && force < -minus_factor_ * coulomb_minus_(position) - extra.breakaway_minus) slip_ = -1;
  }
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
  channels[out_flow_] = flow(now.opening);
  if (out_prestage_flow_ >= 0) channels[out_prestage_flow_] = last_.prestage;
  if (out_cylinder_flow_ >= 0) channels[out_cylinder_flow_] = last_.cylinder;
}

namespace {
FAULTLINE_RIG(control_valve, {"control_valve", 0.5e-3, make_rig<ControlValve>, 2e-3});
}

}  // namespace faultline
