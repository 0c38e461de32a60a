// The equations of my_rig: a tank, filled by a pump, that runs out through an orifice in its floor. Put yours in place
// of it: one class, whose states, parameters, channels and ports are those of config/my_rig/rig.yaml.
//
//   A h' = k_p u - k_o root(p) - flow.tank_ambient,   p = rho g h
//
// h level [m], u pump voltage [V], A area of the tank, k_p flow of the pump per volt, k_o of the outlet. SI units.
#include <algorithm>
#include <cmath>
#include <vector>

#include "faultline/rig/orifice.h"
#include "faultline/rig/rig.h"

namespace faultline {
namespace {

constexpr double kWeight = 9790;     // N/m^3, of water: density times gravity
constexpr double kTransition = 1.0;  // Pa, below which the root turns linear

class MyRig : public Rig {
 public:
  // Ask the datasheet for everything once; a name that it lacks is told with file and line.
  MyRig(const Datasheet& sheet, const std::vector<double>& parameters, const EffectSet& effects)
      : outlet_(effects.at("restriction.outlet")), leak_(effects.at("flow.tank_ambient")) {
    check_state_names(sheet, {"level"});
    const auto value = [&](const char* name) { return parameters[static_cast<std::size_t>(sheet.parameter(name))]; };
    area_ = value("tank_area");
    pump_gain_ = value("pump_gain");
    outlet_coefficient_ = value("outlet_coefficient");
    voltage_ = sheet.channel("pump_voltage");
    level_ = sheet.channel("level");
  }

  int states() const override { return 1; }

  // Where a run begins: here at rest under its first voltage.
  void start(const double* channels, double* state) override {
    state[0] = std::pow(pump_gain_ * channels[voltage_] / outlet_coefficient_, 2) / kWeight;
  }

  void start_at(const double* nominal_state, const double*, double* state) override { state[0] = nominal_state[0]; }

  // d(state)/dt. Each term passes its port, where effects (faults, gaps) change it.
  void derivative(double, const double* state, const double* channels, double* rate) override {
    const double pressure = kWeight * state[0];
    const double out = outlet_.opening(outlet_coefficient_) * signed_root(pressure, kTransition);
    const double leak = leak_.flow({pressure, pressure, 0});
    rate[0] = (pump_gain_ * channels[voltage_] - out - leak) / area_;
  }

  // After every step: limits of the states.
  void after_step(double, double* state, const double*) override { state[0] = std::max(0.0, state[0]); }

  // What the transducers see; their noise and their effects are not your concern.
  void outputs(double, const double* state, double* channels) const override { channels[level_] = state[0]; }

 private:
  double area_, pump_gain_, outlet_coefficient_;
  int voltage_, level_;
  const EffectChain &outlet_, &leak_;
};

// 0.25 s: the step at which the integration has converged.
FAULTLINE_RIG(my_rig, {"my_rig", 0.25, make_rig<MyRig>});

}  // namespace
}  // namespace faultline
