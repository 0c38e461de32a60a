// A rig of three parameters of which two count as a product only:
//
//   tau x' = input_gain output_gain u - x,  output x
#pragma once

#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "faultline/numerics/random.h"
#include "faultline/rig/rig.h"

namespace faultline {

class TwoGains : public Rig {
 public:
  TwoGains(const Datasheet& sheet, const std::vector<double>& parameters, const EffectSet& effects)
      : gain_(value(sheet, parameters, "input_gain") * value(sheet, parameters, "output_gain")),
        time_(value(sheet, parameters, "lag_time")),
        input_(sheet.channel("input")),
        level_(sheet.channel("level")) {
    effects.at("command.input");
    check_state_names(sheet, {"level"});
  }
  int states() const override { return 1; }
  void start(const double* channels, double* state) override { state[0] = gain_ * channels[input_]; }
  void start_at(const double* nominal, const double*, double* state) override { state[0] = nominal[0]; }
  void derivative(double, const double* state, const double* channels, double* rate) override {
    rate[0] = (gain_ * channels[input_] - state[0]) / time_;
  }
  void outputs(double, const double* state, double* channels) const override { channels[level_] = state[0]; }

 private:
  static double value(const Datasheet& sheet, const std::vector<double>& parameters, const char* name) {
    return parameters[static_cast<std::size_t>(sheet.parameter(name))];
  }

  double gain_, time_;
  int input_, level_;
};

FAULTLINE_RIG(two_gains, {"two_gains", 2e-3, make_rig<TwoGains>});

constexpr const char* kSheet = R"(rig: two_gains
title: first order with two gains
source: test
sample_period: 0.01
conventions: test
channels:
  - {name: input, symbol: u, unit: V, role: command, range: [-10, 10], noise_std: 0, resolution: 0, meaning: in}
  - {name: level, symbol: x, unit: V, role: output, range: [-100, 100], noise_std: 0.01, resolution: 0, meaning: out}
states:
  - {name: level, symbol: x, unit: V, measured_by: level, initial: 0}
parameters:
  - {name: input_gain, symbol: a, unit: "1", nominal: 1, tolerance: 0.1, identify: true, from: chosen}
  - {name: output_gain, symbol: b, unit: "1", nominal: 2, tolerance: 0.3, identify: true, from: chosen}
  - {name: lag_time, symbol: tau, unit: s, nominal: 0.2, tolerance: 0.2, identify: true, from: chosen}
constants: {}
equations: tau x' = a b u - x
ports:
  command.input:
    component: amplifier
    meaning: in
    range: 10
    effects: {deadband: {width: [0.05, 2]}, offset: {value: [-1, 1]}, lag: {time_constant: [0.01, 0.3]}}
)";

inline Datasheet two_gains() {
  const std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("faultline_identifiability_" + std::to_string(::getpid()));
  std::filesystem::create_directory(folder);
  const std::string file = (folder / "rig.yaml").string();
  std::ofstream(file) << kSheet;
  const Datasheet read = read_datasheet(file);
  std::filesystem::remove_all(folder);
  return read;
}

// Steps of random height between `lowest` and 4 V, by the exact solution of the equation. `dead`: width of a dead band
// before the gains.
inline Recording two_gains_run(double gain, double time, double duration, std::uint64_t seed, double dead = 0,
                               double lowest = -4) {
  Recording recording;
  recording.rig = "two_gains";
  recording.channels = two_gains().channels;
  Random random(seed);
  double u = 0, x = 0;
  for (int k = 0; k * 0.01 < duration; ++k) {
    if (k % 40 == 0) u = random.uniform(lowest, 4);
    recording.time.push_back(0.01 * k);
    recording.sequence.push_back(static_cast<std::uint64_t>(k));
    recording.values.push_back(u);
    recording.values.push_back(x + 0.01 * random.normal());
    const double passed = std::copysign(std::max(0.0, std::abs(u) - 0.5 * dead), u);
    x = gain * passed + (x - gain * passed) * std::exp(-0.01 / time);
  }
  return recording;
}

}  // namespace faultline
