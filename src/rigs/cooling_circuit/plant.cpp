#include "rigs/cooling_circuit/plant.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "faultline/numerics/quick_power.h"
#include "faultline/numerics/rosenbrock.h"
#include "faultline/rig/orifice.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

enum { kValve, kFiring, kManifold, kFirstBranch };  // states; then P_1, P_2, T_1, T_2 of each branch
constexpr int kBranchStates = 4;

constexpr double kTransition = 100;            // Pa, below which roots and tubes turn linear
constexpr double kTubePower = 8.0 / 7;         // of c
constexpr double kTubeBend = 3.0 / 14;         // tube: x/(x^2 + d^2)^(3/14)
constexpr double kReferenceTemperature = 288;  // K, where the viscosity is nominal
constexpr double kViscositySpan = 15;          // K above it, where the viscosity is factor times nominal
constexpr double kViscosityPower = -0.125;     // of c with the viscosity
constexpr double kSmallestInertance = 1e3;     // Pa s^2/m^3; less settles within nanoseconds
constexpr double kShut = 1e-6;                 // smallest opening that is divided by
constexpr double kTimeStep = 1e-6;             // s, for rates of boundary values
constexpr double kSmallDrop = 1;               // Pa, for slopes of what effects make of a flow
constexpr double kOpeningStep = 1e-7;          // for the slope of the valve's curve
constexpr double kSmallWarming = 1e-3;         // K, for the slope of a flow with viscosity
constexpr int kMostSteps = 20;                 // of Newton's method for the valve's flow

// Where evaluate() puts the Jacobian: nowhere, into a list of places, or into values in the order of that list.
struct NoJacobian {
  static constexpr bool wanted = false;
  void add(int, int, double) {}
  void time(int, double) {}
};
struct Places {
  static constexpr bool wanted = true;
  std::vector<std::pair<int, int>>& entries;
  void add(int row, int column, double) { entries.emplace_back(row, column); }
  void time(int, double) {}
};
struct Values {
  static constexpr bool wanted = true;
  double* next;
  double* time_rate;
  void add(int, int, double value) { *next++ = value; }
  void time(int row, double value) { time_rate[row] += value; }
};

std::pair<double, double> root(double x) { return signed_root_and_slope(x, kTransition); }

const QuickPower tube_power(-kTubeBend);
const QuickPower to_tube_flow(kTubePower), from_tube_flow(1 / kTubePower);  // of 0: next to 0

}  // namespace

CoolingCircuit::CoolingCircuit(const Datasheet& sheet, const std::vector<double>& parameters, const EffectSet& effects)
    : supply_port_(effects.at("source.supply")),
      water_port_(effects.at("source.water")),
      manifold_port_(effects.at("compliance.manifold")),
      feed_line_(effects.at("line.feed")),
      valve_port_(effects.at("restriction.bench_valve")),
      count_(static_cast<int>(sheet.states.size())) {
  std::vector<std::string> names = {"valve_opening", "firing_level", "manifold_pressure"};
  for (const std::string& b : sheet.branches)
    for (const char* state : {"_p1", "_p2", "_t1", "_t2"}) names.push_back(b + state);
  check_state_names(sheet, names);
  const auto value = [&](const std::string& name) {
    return parameters[static_cast<std::size_t>(sheet.parameter(name))];
  };
  density_ = value("density");
  sound_speed_ = value("sound_speed");
  specific_heat_ = value("specific_heat");
  valve_coefficient_ = value("valve_coefficient");
  valve_time_ = value("valve_time_constant");
  manifold_volume_ = value("manifold_volume");
  drain_pressure_ = value("drain_pressure");
  water_temperature_ = value("water_temperature");
  ambient_temperature_ = value("ambient_temperature");
  firing_time_ = value("firing_time_constant");
  supply_ = sheet.channel("supply_pressure");
  valve_command_ = sheet.channel("bench_valve_command");
  heat_command_ = sheet.channel("heat_load_command");
  for (const State& state : sheet.states) state_names_.push_back(state.name);
  channels_ = sheet.channels.size();
  if (!feed_line_.empty()) feed_ = count_++;
  int state = kFirstBranch;
  for (const std::string& b : sheet.branches) {
    Branch branch{};
    branch.compliance = value(b + "_b");
    branch.tube = std::pow(value(b + "_c"), kTubePower);
    branch.feed = value(b + "_feed_coefficient");
    branch.drain = value(b + "_drain_coefficient");
    branch.heat_flux = value(b + "_heat_flux");
    branch.reference_flow = sheet.port("restriction." + b + "_orifice").range;
    branch.leak_inlet = &effects.at("flow." + b + "_inlet_ambient");
    branch.leak_outlet = &effects.at("flow." + b + "_outlet_ambient");
    branch.leak_drain = &effects.at("flow." + b + "_drain_ambient");
    branch.feed_port = &effects.at("restriction." + b + "_feed");
    branch.tube_port = &effects.at("restriction." + b + "_orifice");
    branch.drain_port = &effects.at("restriction." + b + "_drain");
    branch.back_pressure = &effects.at("source." + b + "_drain");
    branch.line_port = &effects.at("line." + b + "_orifice");
    branch.wall = &effects.at("heat." + b + "_wall");
    branch.inlet = sheet.channel(b + "_inlet_pressure");
    branch.outlet = sheet.channel(b + "_outlet_pressure");
    branch.meter = sheet.channel(b + "_mass_flow");
    branch.inlet_temperature = sheet.channel(b + "_inlet_temperature");
    branch.outlet_temperature = sheet.channel(b + "_outlet_temperature");
    branch.state = state;
    state += kBranchStates;
    if (!branch.line_port->empty()) branch.line = count_++;
    branches_.push_back(branch);
  }
  // The places of the Jacobian's entries: those of any state, so one where all is well defined.
  std::vector<double> somewhere(static_cast<std::size_t>(count_), drain_pressure_), rate(somewhere.size());
  const std::vector<double> channels(sheet.channels.size(), 0.0);
  for (const bool rest : {true, false}) {
    at_rest_ = rest;
    Places places{rest ? rest_entries_ : entries_};
    evaluate(0, somewhere.data(), channels.data(), rate.data(), places);
  }
}

double CoolingCircuit::viscosity(double temperature) const {
  if (water_port_.empty()) return 1;
  const double rate = kTubePower * kViscosityPower * std::log(water_port_.viscosity().factor) / kViscositySpan;
  return std::exp(rate * (temperature - kReferenceTemperature));
}

CoolingCircuit::Flow CoolingCircuit::tube(const Branch& branch, double drop, double viscosity) const {
  const auto plain = [&](double x) {
    const double y = x * x + kTransition * kTransition, p = branch.tube * viscosity * tube_power(y);
    return Flow{x * p, p * (1 - 2 * kTubeBend * x * x / y)};
  };
  if (branch.tube_port->empty()) return plain(drop);
  // Effects act on c sqrt(x), scaled such that it is the flow q_r where the flow is q_r.
  const auto changed = [&](double x) {
    const double q_r = branch.reference_flow, q = plain(x).value;
    const double opening = branch.tube_port->opening(q_r * from_tube_flow(std::abs(q) / q_r));
    return std::copysign(q_r * to_tube_flow(std::max(opening, 0.0) / q_r), q);
  };
  const double step = std::max(kSmallDrop, 1e-5 * std::abs(drop));
  return {changed(drop), (changed(drop + step) - changed(drop - step)) / (2 * step)};
}

CoolingCircuit::Flow CoolingCircuit::leak(const EffectChain& chain, double pressure) const {
  if (chain.empty()) return {};
  const auto flow = [&](double drop) { return density_ * chain.flow({drop, drop, 0}); };
  const double drop = pressure - drain_pressure_;
  return {flow(drop), (flow(drop + kSmallDrop) - flow(drop - kSmallDrop)) / (2 * kSmallDrop)};
}

CoolingCircuit::Flow CoolingCircuit::drain(const Branch& branch, double pressure, double time) const {
  const double coefficient = branch.drain_port->opening(branch.drain);
  const auto [value, slope] = root(pressure - branch.back_pressure->boundary(drain_pressure_, 0, time));
  return {coefficient * value, coefficient * slope};
}

double CoolingCircuit::valve(double opening) const {
  return valve_coefficient_ * valve_port_.opening(std::max(opening, 0.0));
}

double CoolingCircuit::valve_flow(double coefficient, double measured, double manifold, double time) const {
  const auto pressure = [&](double flow) { return supply_port_.boundary(measured, flow / density_, time); };
  double q = coefficient * root(pressure(0) - manifold).first;
  if (supply_port_.empty() || q == 0) return q;
  // Newton's method on q - k root(P(q) - P_m), which rises with q; P falls linearly with the flow.
  const double fall = pressure(0) - pressure(1);  // Pa per kg/s
  for (int i = 0; fall > 0 && i < kMostSteps; ++i) {
    const auto [value, slope] = root(pressure(q) - manifold);
    const double step = (q - coefficient * value) / (1 + coefficient * slope * fall);
    q -= step;
    if (std::abs(step) <= 1e-13 * std::abs(q)) break;
  }
  return q;
}

double CoolingCircuit::manifold_compliance(double pressure) const {
  const double modulus = density_ * sound_speed_ * sound_speed_;
  if (at_rest_) return manifold_volume_ * density_ / modulus;
  return manifold_volume_ * density_ / manifold_port_.bulk_modulus(modulus, pressure);
}

template <class Sink>
void CoolingCircuit::evaluate(double time, const double* state, const double* channels, double* rate,
                              Sink& sink) const {
  if (at_rest_) std::fill_n(rate, count_, 0.0);
  rate[kValve] = (std::clamp(channels[valve_command_], 0.0, 1.0) - state[kValve]) / valve_time_;
  rate[kFiring] = (std::max(channels[heat_command_], 0.0) - state[kFiring]) / firing_time_;
  sink.add(kValve, kValve, -1 / valve_time_);
  sink.add(kFiring, kFiring, -1 / firing_time_);

  const int feed = at_rest_ ? -1 : feed_;
  const double manifold = state[kManifold], measured = channels[supply_];
  const double coefficient = valve(state[kValve]);
  const double flow =
      feed >= 0 ? coefficient * root(state[feed]).first : valve_flow(coefficient, measured, manifold, time);
  const auto supply = [&](double mass_flow, double t) {
    return supply_port_.boundary(measured, mass_flow / density_, t);
  };
  const auto water = [&](double t) { return water_port_.boundary(water_temperature_, flow / density_, t); };
  Header header;
  header.compliance = manifold_compliance(manifold);
  header.water = water(time);
  if constexpr (Sink::wanted) header.water_rate = (water(time + kTimeStep) - header.water) / kTimeStep;
  for (const Branch& branch : branches_) evaluate(branch, time, state, header, rate, sink);
  rate[kManifold] = (flow - header.drawn) / header.compliance;
  if (feed < 0 && !Sink::wanted) return;

  const double pressure = supply(flow, time);
  const double inertia = std::max(feed_line_.line().inertance, kSmallestInertance) / density_;
  // Of x, the pressure over the valve: q = K root(x), inertia q' = P - P_m - x.
  const auto feed_rate = [&](double x, double opening) {
    const double k = valve(opening), k_slope = (valve(opening + kOpeningStep) - k) / kOpeningStep;
    const double opens = (std::clamp(channels[valve_command_], 0.0, 1.0) - opening) / valve_time_;
    const auto [value, slope] = root(x);
    return ((supply(k * value, time) - manifold - x) / inertia - k_slope * opens * value) /
           (std::max(k, valve_coefficient_ * kShut) * slope);
  };
  if (feed >= 0) rate[feed] = feed_rate(state[feed], state[kValve]);
  if constexpr (Sink::wanted) {
    const double by_opening = (valve(state[kValve] + kOpeningStep) - coefficient) / kOpeningStep;
    const double pressure_rate = (supply(flow, time + kTimeStep) - pressure) / kTimeStep;
    const auto [value, slope] = root(feed < 0 ? pressure - manifold : state[feed]);
    double by_manifold = -header.drawn_slope;
    if (feed < 0) {
      const double fall = pressure - supply(flow + 1, time);  // Pa per kg/s
      const double share = 1 / (1 + coefficient * slope * fall);
      by_manifold -= coefficient * slope * share;
      sink.add(kManifold, kValve, by_opening * value * share / header.compliance);
      sink.time(kManifold, coefficient * slope * share * pressure_rate / header.compliance);
    } else {
      const double x = state[feed], step = std::max(kSmallDrop, 1e-5 * std::abs(x));
      const double per_pascal = 1 / (inertia * std::max(coefficient, valve_coefficient_ * kShut) * slope);
      sink.add(kManifold, kValve, by_opening * value / header.compliance);
      sink.add(kManifold, feed, coefficient * slope / header.compliance);
      sink.add(feed, feed, (feed_rate(x + step, state[kValve]) - feed_rate(x - step, state[kValve])) / (2 * step));
      sink.add(feed, kManifold, -per_pascal);
      sink.add(feed, kValve, (feed_rate(x, state[kValve] + kOpeningStep) - rate[feed]) / kOpeningStep);
      sink.time(feed, per_pascal * pressure_rate);
    }
    const double softer = manifold_compliance(manifold + kSmallDrop) - header.compliance;
    sink.add(kManifold, kManifold, (by_manifold - rate[kManifold] * softer / kSmallDrop) / header.compliance);
  }
}

template <class Sink>
void CoolingCircuit::evaluate(const Branch& branch, double time, const double* state, Header& header, double* rate,
                              Sink& sink) const {
  const int p1 = branch.state, p2 = p1 + 1, t1 = p1 + 2, t2 = p1 + 3, line = at_rest_ ? -1 : branch.line;
  const double b = branch.compliance;
  const double coefficient = branch.feed_port->opening(branch.feed);
  const auto [feed_root, feed_root_slope] = root(state[kManifold] - state[p1]);
  const Flow feed{coefficient * feed_root, coefficient * feed_root_slope};
  const double drop = line < 0 ? state[p1] - state[p2] : state[line];
  const double viscous = viscosity(0.5 * (state[t1] + state[t2]));
  const Flow through = tube(branch, drop, viscous);
  const Flow out = drain(branch, state[p2], time);
  const Flow leak_inlet = leak(*branch.leak_inlet, state[p1]);
  const Flow leak_outlet = leak(*branch.leak_outlet, state[p2]);
  const Flow leak_drain = leak(*branch.leak_drain, state[p2]);
  header.drawn += feed.value;
  header.drawn_slope += feed.slope;

  rate[p1] = (feed.value - through.value - leak_inlet.value) / b;
  rate[p2] = (through.value - out.value - leak_drain.value - leak_outlet.value) / b;
  const HeatPath wall = branch.wall->heat();
  const double mass = density_ * b * sound_speed_ * sound_speed_;
  const double capacity = mass * specific_heat_ + wall.capacity;
  const double into_1 = std::max(feed.value, 0.0), into_2 = specific_heat_ * std::max(through.value, 0.0);
  rate[t1] = into_1 * (header.water - state[t1]) / mass;
  rate[t2] = (into_2 * (state[t1] - state[t2]) + branch.heat_flux * wall.factor * state[kFiring] -
              wall.loss * (state[t2] - ambient_temperature_)) /
             capacity;
  const auto line_rate = [&](double x, double slope) {
    const double inertia = std::max(branch.line_port->line().inertance, kSmallestInertance) / density_;
    return (state[p1] - state[p2] - x) / (inertia * slope);
  };
  if (line >= 0) rate[line] = line_rate(drop, through.slope);

  if constexpr (Sink::wanted) {
    const double to_1 = feed.value > 0 ? (header.water - state[t1]) / mass : 0.0;
    const double to_2 = through.value > 0 ? specific_heat_ * (state[t1] - state[t2]) / capacity : 0.0;
    sink.add(kManifold, p1, feed.slope / header.compliance);
    sink.add(p1, kManifold, feed.slope / b);
    sink.add(p1, p1, (-feed.slope - leak_inlet.slope) / b);
    sink.add(p2, p2, (-out.slope - leak_outlet.slope - leak_drain.slope) / b);
    sink.add(t1, kManifold, to_1 * feed.slope);
    sink.add(t1, p1, -to_1 * feed.slope);
    sink.add(t1, t1, -into_1 / mass);
    sink.add(t2, t1, into_2 / capacity);
    sink.add(t2, t2, -(into_2 + wall.loss) / capacity);
    sink.add(t2, kFiring, branch.heat_flux * wall.factor / capacity);
    // The tube's flow, by what drives it.
    const auto by_flow = [&](int column, double slope) {
      sink.add(p1, column, -slope / b);
      sink.add(p2, column, slope / b);
      sink.add(t2, column, to_2 * slope);
    };
    if (line < 0) {
      by_flow(p1, through.slope);
      by_flow(p2, -through.slope);
    } else {
      by_flow(line, through.slope);
      const double step = std::max(kSmallDrop, 1e-4 * std::abs(drop));
      const auto rate_at = [&](double x) { return line_rate(x, tube(branch, x, viscous).slope); };
      const double per_pascal = line_rate(drop - 1, through.slope) - rate[line];
      sink.add(line, line, (rate_at(drop + step) - rate_at(drop - step)) / (2 * step));
      sink.add(line, p1, per_pascal);
      sink.add(line, p2, -per_pascal);
    }
    if (!water_port_.empty()) {
      const double warmer = viscosity(0.5 * (state[t1] + state[t2]) + kSmallWarming);
      const double slope = (tube(branch, drop, warmer).value - through.value) / (2 * kSmallWarming);
      for (const int column : {t1, t2}) {
        by_flow(column, slope);
        if (line >= 0) sink.add(line, column, -rate[line] * (warmer / viscous - 1) / (2 * kSmallWarming));
      }
      sink.time(t1, into_1 * header.water_rate / mass);
    }
    if (!branch.back_pressure->empty())
      sink.time(p2, (out.value - drain(branch, state[p2], time + kTimeStep).value) / (kTimeStep * b));
  }
}

void CoolingCircuit::derivative(double time, const double* state, const double* channels, double* rate) {
  NoJacobian none;
  evaluate(time, state, channels, rate, none);
}

void CoolingCircuit::jacobian(double time, const double* state, const double* channels, double* rate, double* time_rate,
                              double* entries) {
  std::fill_n(time_rate, count_, 0.0);
  Values values{entries, time_rate};
  evaluate(time, state, channels, rate, values);
}

std::vector<int> CoolingCircuit::come_to_rest(const double* channels, double* state) {
  state[kValve] = std::clamp(channels[valve_command_], 0.0, 1.0);
  state[kFiring] = std::max(channels[heat_command_], 0.0);
  state[kManifold] = drain_pressure_;
  for (const Branch& branch : branches_) {
    state[branch.state] = state[branch.state + 1] = drain_pressure_;
    state[branch.state + 2] = state[branch.state + 3] = water_temperature_;
  }
  at_rest_ = true;
  const std::vector<int> moving = settle(*this, channels, state);
  at_rest_ = false;
  return moving;
}

void CoolingCircuit::start(const double* channels, double* state) {
  std::vector<int> moving = come_to_rest(channels, state);
  const auto moves = [&moving](int s) { return std::find(moving.begin(), moving.end(), s) != moving.end(); };
  // Water that stands has no temperature of rest of its own, and none at all where it is heated: it is as it came. The
  // pressures are then those without heat, since water of a million kelvins would have set them.
  const std::vector<double> heated(state, state + count_);
  for (Branch& branch : branches_) branch.stands = state[kValve] <= 0 || moves(branch.state + 3);
  if (!moving.empty()) {
    std::vector<double> unheated(channels, channels + channels_);
    unheated[static_cast<std::size_t>(heat_command_)] = 0;
    moving = come_to_rest(unheated.data(), state);
    state[kFiring] = std::max(channels[heat_command_], 0.0);
  }
  for (const Branch& branch : branches_)
    for (const int s : {branch.state + 2, branch.state + 3})
      state[s] = branch.stands ? water_temperature_ : heated[static_cast<std::size_t>(s)];
  if (!moving.empty())
    throw InputError(fmt::format(
        "cooling_circuit: no state of rest to start from: {} does not settle at a supply of {:g} Pa with the valve at "
        "{:g}; check "
        "both, the parameters and the effects",
        state_names_[static_cast<std::size_t>(moving.front())], channels[supply_], channels[valve_command_]));
  start_at(state, channels, state);
}

void CoolingCircuit::start_as_shown(const std::function<double(int channel)>& shown, double* state) {
  for (const Branch& branch : branches_) {
    if (!branch.stands) continue;
    const int channels[2] = {branch.inlet_temperature, branch.outlet_temperature};
    for (int i = 0; i < 2; ++i)
      if (const double value = shown(channels[i]); std::isfinite(value)) state[branch.state + 2 + i] = value;
  }
}

void CoolingCircuit::start_at(const double* nominal_state, const double* channels, double* state) {
  std::copy_n(nominal_state, kFirstBranch + kBranchStates * static_cast<int>(branches_.size()), state);
  if (feed_ >= 0) {
    const double flow = valve_flow(valve(state[kValve]), channels[supply_], state[kManifold], 0);
    state[feed_] = supply_port_.boundary(channels[supply_], flow / density_, 0) - state[kManifold];
  }
  for (const Branch& branch : branches_)
    if (branch.line >= 0) state[branch.line] = state[branch.state] - state[branch.state + 1];
}

void CoolingCircuit::outputs(double time, const double* state, double* channels) const {
  for (const Branch& branch : branches_) {
    const double* at = state + branch.state;
    channels[branch.inlet] = at[0];
    channels[branch.outlet] = at[1];
    channels[branch.meter] = drain(branch, at[1], time).value + leak(*branch.leak_drain, at[1]).value;
    channels[branch.inlet_temperature] = at[2];
    channels[branch.outlet_temperature] = at[3];
  }
}

namespace {
// A water column against the stiffness of a cavity, and what swings up to 120 times a second.
bool is_fast(const EffectSpec& effect) { return effect.effect == "line_inertia" || effect.effect == "ripple"; }

// Valve and firing settle in 150 ms, temperatures in 60 ms, pressures within a step: means over 5 ms show all of it.
FAULTLINE_RIG(cooling_circuit, {"cooling_circuit", 0.25e-3, make_rig<CoolingCircuit>, 5e-3, 0, 1e-3, is_fast, 0, 5e-3});
}  // namespace

}  // namespace faultline
