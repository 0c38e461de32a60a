#include <algorithm>
#include <cmath>

#include "faultline/rig/orifice.h"
#include "faultline/rig/rig.h"

namespace faultline {
namespace {

double root(double y) { return std::sqrt(std::max(y, 0.0)); }

// A h_1' = k u - a_1 sqrt(2 g h_1) - leak,  A h_2' = a_1 sqrt(2 g h_1) - a_2 sqrt(2 g h_2)
class TwoTanks : public Rig {
 public:
  TwoTanks(const Datasheet& sheet, const std::vector<double>& parameters, const EffectSet& effects)
      : upper_(effects.at("restriction.upper_outlet")),
        lower_(effects.at("restriction.lower_outlet")),
        leak_(effects.at("flow.upper_floor")) {
    check_state_names(sheet, {"upper_level", "lower_level"});
    const auto value = [&](const char* name) { return parameters[static_cast<std::size_t>(sheet.parameter(name))]; };
    area_ = value("tank_area");
    upper_area_ = value("upper_outlet_area");
    lower_area_ = value("lower_outlet_area");
    gain_ = value("pump_gain");
    pump_ = sheet.channel("pump_voltage");
    level_ = sheet.channel("lower_level");
  }
  int states() const override { return 2; }
  void start(const double* channels, double* state) override {
    const double flow = gain_ * channels[pump_];
    state[0] = std::pow(flow / upper_area_, 2) / (2 * kGravity);
    state[1] = std::pow(flow / lower_area_, 2) / (2 * kGravity);
  }
  void start_at(const double* nominal, const double*, double* state) override { std::copy_n(nominal, 2, state); }
  void derivative(double, const double* state, const double* channels, double* rate) override {
    const double down = upper_area_ * upper_.opening(1) * root(2 * kGravity * state[0]);
    const double pressure = kDensity * kGravity * std::max(state[0], 0.0);
    const double out = lower_area_ * lower_.opening(1) * root(2 * kGravity * state[1]);
    rate[0] = (gain_ * channels[pump_] - down - leak_.flow({pressure, pressure, 0})) / area_;
    rate[1] = (down - out) / area_;
  }
  void after_step(double, double* state, const double*) override {
    state[0] = std::max(state[0], 0.0);
    state[1] = std::max(state[1], 0.0);
  }
  void outputs(double, const double* state, double* channels) const override { channels[level_] = state[1]; }

 private:
  static constexpr double kGravity = 9.81, kDensity = 1000;
  const EffectChain &upper_, &lower_, &leak_;
  double area_, upper_area_, lower_area_, gain_;
  int pump_, level_;
};

// x'' = w^2 (k u - x) - 2 z w x',  C p' = K x root(P_s - p) - c root(p) - leak
class FastValve : public Rig {
 public:
  FastValve(const Datasheet& sheet, const std::vector<double>& parameters, const EffectSet& effects)
      : valve_(effects.at("restriction.valve")), leak_(effects.at("flow.chamber_tank")) {
    check_state_names(sheet, {"spool_position", "spool_velocity", "chamber_pressure"});
    const auto value = [&](const char* name) { return parameters[static_cast<std::size_t>(sheet.parameter(name))]; };
    frequency_ = value("spool_frequency");
    damping_ = value("spool_damping");
    spool_gain_ = value("spool_gain");
    flow_gain_ = value("flow_gain");
    drain_ = value("drain_coefficient");
    capacity_ = value("capacity");
    coil_ = sheet.channel("coil_voltage");
    supply_ = sheet.channel("supply_pressure");
    spool_ = sheet.channel("spool_position");
    pressure_ = sheet.channel("chamber_pressure");
  }
  int states() const override { return 3; }
  void start(const double* channels, double* state) override {
    const double opening = flow_gain_ * spool_gain_ * channels[coil_];
    state[0] = spool_gain_ * channels[coil_];
    state[1] = 0;
    state[2] = channels[supply_] * opening * opening / (opening * opening + drain_ * drain_);
  }
  void start_at(const double* nominal, const double*, double* state) override { std::copy_n(nominal, 3, state); }
  void derivative(double, const double* state, const double* channels, double* rate) override {
    const double p = state[2];
    rate[0] = state[1];
    rate[1] =
        frequency_ * frequency_ * (spool_gain_ * channels[coil_] - state[0]) - 2 * damping_ * frequency_ * state[1];
    rate[2] = (flow_gain_ * std::max(valve_.opening(state[0]), 0.0) * signed_root(channels[supply_] - p, 1e4) -
               drain_ * signed_root(p, 1e4) - leak_.flow({p, p, 0})) /
              capacity_;
  }
  void outputs(double, const double* state, double* channels) const override {
    channels[spool_] = state[0];
    channels[pressure_] = state[2];
  }

 private:
  const EffectChain &valve_, &leak_;
  double frequency_, damping_, spool_gain_, flow_gain_, drain_, capacity_;
  int coil_, supply_, spool_, pressure_;
};

// tau x_i' = x_{i-1} - x_i,  x_0 = u
class LongChain : public Rig {
 public:
  LongChain(const Datasheet& sheet, const std::vector<double>& parameters, const EffectSet&)
      : states_(static_cast<int>(sheet.states.size())),
        time_(parameters[static_cast<std::size_t>(sheet.parameter("lag_time"))]),
        in_(sheet.channel("heater_voltage")),
        out_(sheet.channel("end_voltage")) {}
  int states() const override { return states_; }
  void start(const double* channels, double* state) override { std::fill_n(state, states_, channels[in_]); }
  void start_at(const double* nominal, const double*, double* state) override { std::copy_n(nominal, states_, state); }
  void derivative(double, const double* state, const double* channels, double* rate) override {
    for (int i = 0; i < states_; ++i) rate[i] = ((i > 0 ? state[i - 1] : channels[in_]) - state[i]) / time_;
  }
  void outputs(double, const double* state, double* channels) const override { channels[out_] = state[states_ - 1]; }

 private:
  int states_;
  double time_;
  int in_, out_;
};

FAULTLINE_RIG(two_tanks, {"two_tanks", 1.0, make_rig<TwoTanks>});
FAULTLINE_RIG(long_chain, {"long_chain", 0.05, make_rig<LongChain>});
FAULTLINE_RIG(fast_valve, {"fast_valve", 0.5e-4, make_rig<FastValve>});

}  // namespace
}  // namespace faultline
