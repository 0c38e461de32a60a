// A mass on a spring and a damper that a command pushes:
//
//   mass v' = gain u - damping v - stiffness x - f,  x' = v,  outputs x and v
//
// f: what passes force.mass, and what a truth has that the datasheet does not know.
#pragma once

#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>

#include "faultline/numerics/random.h"
#include "faultline/rig/rig.h"

namespace faultline {

class SlidingMass : public Rig {
 public:
  SlidingMass(const Datasheet& sheet, const std::vector<double>& parameters, const EffectSet& effects)
      : parameters_(parameters),
        force_(effects.at("force.mass")),
        command_(sheet.channel("command")),
        position_(sheet.channel("position")),
        velocity_(sheet.channel("velocity")) {
    effects.at("command.command");
    for (const char* name : {"mass", "gain", "damping", "stiffness"}) sheet.parameter(name);
    check_state_names(sheet, {"position", "velocity"});
  }
  int states() const override { return 2; }
  void start(const double*, double* state) override { state[0] = state[1] = 0; }
  void start_at(const double* nominal, const double*, double* state) override {
    state[0] = nominal[0];
    state[1] = nominal[1];
  }
  void derivative(double, const double* state, const double* channels, double* rate) override {
    const BodyForces forces = force_.forces({state[0], state[1], 0});
    rate[0] = state[1];
    rate[1] = (parameters_[1] * channels[command_] - parameters_[2] * state[1] - parameters_[3] * state[0] -
               forces.applied - forces.viscous) /
              (parameters_[0] + forces.mass);
  }
  void outputs(double, const double* state, double* channels) const override {
    channels[position_] = state[0];
    channels[velocity_] = state[1];
  }

 private:
  std::vector<double> parameters_;
  const EffectChain& force_;
  int command_, position_, velocity_;
};

FAULTLINE_RIG(sliding_mass, {"sliding_mass", 2e-3, make_rig<SlidingMass>});

constexpr const char* kSlidingMass = R"(rig: sliding_mass
title: mass on a spring
source: test
sample_period: 0.01
conventions: test
channels:
  - {name: command, symbol: u, unit: V, role: command, range: [-10, 10], noise_std: 0, resolution: 0, meaning: in}
  - {name: position, symbol: x, unit: m, role: output, range: [-2, 2], noise_std: 1e-4, resolution: 0, meaning: out}
  - {name: velocity, symbol: v, unit: m/s, role: output, range: [-9, 9], noise_std: 1e-3, resolution: 0, meaning: out}
states:
  - {name: position, symbol: x, unit: m, measured_by: position, initial: 0}
  - {name: velocity, symbol: v, unit: m/s, measured_by: velocity, initial: 0}
parameters:
  - {name: mass, symbol: m, unit: kg, nominal: 2, tolerance: 0.02, identify: true, from: chosen}
  - {name: gain, symbol: k, unit: N/V, nominal: 10, tolerance: 0.02, identify: true, from: chosen}
  - {name: damping, symbol: d, unit: N s/m, nominal: 8, tolerance: 0.1, identify: true, from: chosen}
  - {name: stiffness, symbol: c, unit: N/m, nominal: 100, tolerance: 0.02, identify: true, from: chosen}
constants: {}
equations: mass v' = gain u - damping v - stiffness x
ports:
  command.command:
    component: amplifier
    meaning: in
    range: 10
    effects: {deadband: {width: [0.05, 2]}, offset: {value: [-1, 1]}}
  force.mass:
    component: mass
    meaning: out
    effects: {viscous_friction: {coefficient: [0.5, 20]}, added_mass: {mass: [0.02, 1]}}
  sensor.position:
    component: position transducer
    meaning: out
    effects: {offset: {value: [-0.05, 0.05]}, scale: {factor: [0.9, 1.1]}}
  sensor.velocity:
    component: velocity transducer
    meaning: out
    effects: {offset: {value: [-0.2, 0.2]}, scale: {factor: [0.9, 1.1]}}
)";

// `more`: further keys of the datasheet.
inline Datasheet sliding_mass(const std::string& more = "") {
  const std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("faultline_sliding_mass_" + std::to_string(::getpid()));
  std::filesystem::create_directory(folder);
  const std::string file = (folder / "rig.yaml").string();
  std::ofstream(file) << kSlidingMass << more;
  const Datasheet read = read_datasheet(file);
  std::filesystem::remove_all(folder);
  return read;
}

// Steps of random height, each held for so many samples, by Heun's rule at 0.2 ms. `force`: f of position and velocity.
inline Recording sliding_mass_run(double duration, std::uint64_t seed,
                                  const std::function<double(double x, double v)>& force, int held = 40) {
  Recording recording;
  recording.rig = "sliding_mass";
  recording.channels = sliding_mass().channels;
  Random random(seed);
  double u = 0, x = 0, v = 0;
  const auto rate = [&](double at, double speed) { return (10 * u - 8 * speed - 100 * at - force(at, speed)) / 2; };
  for (int k = 0; k * 0.01 < duration; ++k) {
    if (k % held == 0) u = random.uniform(-6, 6);
    recording.time.push_back(0.01 * k);
    recording.sequence.push_back(static_cast<std::uint64_t>(k));
    for (const double value : {u, x + 1e-4 * random.normal(), v + 1e-3 * random.normal()})
      recording.values.push_back(value);
    for (int i = 0; i < 50; ++i) {
      constexpr double kStep = 2e-4;
      const double first = rate(x, v), second = rate(x + kStep * v, v + kStep * first);
      x += kStep * (v + 0.5 * kStep * first);
      v += 0.5 * kStep * (first + second);
    }
  }
  return recording;
}

}  // namespace faultline
