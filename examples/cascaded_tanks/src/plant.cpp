// Two tanks, one above the other: a pump fills the upper one, which runs out into the lower one, which runs out into
// the reservoir. Levels in volts of a transducer of 10 V over the height of a tank; that of the upper one is not
// measured. After Schoukens and Noel, "Three benchmarks addressing open challenges in nonlinear system identification",
// IFAC-PapersOnLine 50 (2017) 446-451.
//
//   x_1' = k_p u - k_1 root(x_1) - o_12 - o_1r
//   x_2' = k_1 root(x_1) + a_12 - k_2 root(x_2 + d) - o_2r
//
// d: how far the outlet of the lower tank lies below the transducer's zero. o: what leaves through the ports flow.*, in
// V/s, driven by the level in V; a_12: what of o_12 falls into the lower tank. The tanks are alike, so what leaves the
// upper one comes to the lower one volt for volt. Levels are 0 or more; nothing overflows unless an effect says so.
#include <algorithm>
#include <cmath>
#include <vector>

#include "faultline/rig/orifice.h"
#include "faultline/rig/rig.h"

namespace faultline {
namespace {

constexpr double kTransition = 0.01;  // V, below which the root turns linear

class CascadedTanks : public Rig {
 public:
  CascadedTanks(const Datasheet& sheet, const std::vector<double>& parameters, const EffectSet& effects)
      : upper_outlet_(effects.at("restriction.upper_outlet")),
        lower_outlet_(effects.at("restriction.lower_outlet")),
        upper_lower_(effects.at("flow.upper_lower")),
        upper_reservoir_(effects.at("flow.upper_reservoir")),
        lower_reservoir_(effects.at("flow.lower_reservoir")) {
    check_state_names(sheet, {"upper_level", "lower_level"});
    const auto value = [&](const char* name) { return parameters[static_cast<std::size_t>(sheet.parameter(name))]; };
    pump_gain_ = value("pump_gain");
    upper_ = value("upper_outlet");
    lower_ = value("lower_outlet");
    drop_ = value("outlet_drop");
    voltage_ = sheet.channel("pump_voltage");
    level_ = sheet.channel("lower_level");
  }

  int states() const override { return 2; }

  void start(const double* channels, double* state) override {  // at rest under the first voltage
    const double flow = pump_gain_ * std::max(0.0, channels[voltage_]);
    state[0] = std::pow(flow / upper_, 2);
    state[1] = std::max(0.0, std::pow(flow / lower_, 2) - drop_);
  }

  void start_at(const double* nominal_state, const double*, double* state) override {
    std::copy_n(nominal_state, 2, state);
  }

  void derivative(double, const double* state, const double* channels, double* rate) override {
    const double into_lower = upper_outlet_.opening(upper_) * signed_root(upper_outlet_.drop(state[0]), kTransition);
    // An empty tank gives nothing, though its outlet lies lower.
    const double share = std::min(1.0, std::max(0.0, state[1]) / kTransition);
    const double head = lower_outlet_.drop(std::max(0.0, state[1]) + drop_);
    const double out = share * lower_outlet_.opening(lower_) * signed_root(head, kTransition);
    const LeakPath upper{state[0], state[0], 0}, lower{state[1], state[1], 0};
    rate[0] = pump_gain_ * channels[voltage_] - into_lower - upper_lower_.flow(upper) - upper_reservoir_.flow(upper);
    rate[1] = into_lower + upper_lower_.arriving(upper) - out - lower_reservoir_.flow(lower);
  }

  void after_step(double, double* state, const double*) override {
    for (int i = 0; i < 2; ++i) state[i] = std::max(0.0, state[i]);
  }

  void outputs(double, const double* state, double* channels) const override { channels[level_] = state[1]; }

 private:
  double pump_gain_, upper_, lower_, drop_;
  int voltage_, level_;
  const EffectChain &upper_outlet_, &lower_outlet_, &upper_lower_, &upper_reservoir_, &lower_reservoir_;
};

FAULTLINE_RIG(cascaded_tanks, {"cascaded_tanks", 1.0, make_rig<CascadedTanks>});

}  // namespace
}  // namespace faultline
