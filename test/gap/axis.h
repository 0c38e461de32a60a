// A carriage on a rail that a motor pushes, of which an encoder shows the position alone:
//
//   mass v' = gain u - viscous v - f,  x' = v,  output x
//
// f: what passes force.carriage, its friction as smooth as tanh(v/1 mm/s); a truth sticks and breaks away.
#pragma once

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include "faultline/numerics/random.h"
#include "faultline/rig/rig.h"
#include "faultline/signal/sample.h"

namespace faultline {

class Axis : public Rig {
 public:
  Axis(const Datasheet& sheet, const std::vector<double>& parameters, const EffectSet& effects)
      : parameters_(parameters),
        force_(effects.at("force.carriage")),
        voltage_(sheet.channel("voltage")),
        position_(sheet.channel("position")) {
    effects.at("command.voltage");
    for (const char* name : {"gain", "mass", "viscous"}) sheet.parameter(name);
    check_state_names(sheet, {"position", "velocity"});
  }
  int states() const override { return 2; }
  void start(const double*, double* state) override { state[0] = state[1] = 0; }
  void start_at(const double* nominal, const double*, double* state) override { std::copy_n(nominal, 2, state); }
  void derivative(double, const double* state, const double* channels, double* rate) override {
    const BodyForces forces = force_.forces({state[0], state[1], 0});
    const double slow = std::exp(-std::abs(state[1]) / 0.01);
    const auto level = [slow](double sliding, double breakaway) { return sliding + (breakaway - sliding) * slow; };
    const double friction = state[1] > 0 ? level(forces.sliding_plus, forces.breakaway_plus)
                                         : level(forces.sliding_minus, forces.breakaway_minus);
    rate[0] = state[1];
    rate[1] = (parameters_[0] * channels[voltage_] - parameters_[2] * state[1] - forces.applied - forces.viscous -
               friction * std::tanh(state[1] / 1e-3)) /
              (parameters_[1] + forces.mass);
  }
  void outputs(double, const double* state, double* channels) const override { channels[position_] = state[0]; }

 private:
  std::vector<double> parameters_;
  const EffectChain& force_;
  int voltage_, position_;
};

FAULTLINE_RIG(axis, {"axis", 5e-4, make_rig<Axis>});

constexpr const char* kAxis = R"(rig: axis
title: carriage on a rail
source: test
sample_period: 0.01
conventions: test
channels:
  - {name: voltage, symbol: u, unit: V, role: command, range: [-10, 10], noise_std: 0, resolution: 0, meaning: in}
  - {name: position, symbol: x, unit: m, role: output, range: [-5, 5], noise_std: 1e-7, resolution: 0, meaning: out}
states:
  - {name: position, symbol: x, unit: m, measured_by: position, initial: 0}
  - {name: velocity, symbol: v, unit: m/s, initial: 0}
parameters:
  - {name: gain, symbol: k, unit: N/V, nominal: 35, tolerance: 0.05, identify: true, from: chosen}
  - {name: mass, symbol: m, unit: kg, nominal: 95, tolerance: 0.1, identify: true, from: chosen}
  - {name: viscous, symbol: d, unit: N s/m, nominal: 200, tolerance: 0.2, identify: true, from: chosen}
constants: {}
equations: mass v' = gain u - viscous v - f
ports:
  command.voltage:
    component: drive
    meaning: in
    range: 10
    effects: {offset: {value: [-1, 1]}, deadband: {width: [0, 2]}, scale: {factor: [0.7, 1.3]}}
  force.carriage:
    component: carriage
    meaning: friction and load
    range: 350
    effects:
      coulomb_friction: {force: [0, 100]}
      stribeck_friction: {static_excess: [0, 40], velocity: [0.001, 0.1]}
      viscous_friction: {coefficient: [0, 400]}
      load_force: {constant: [-50, 50], stiffness: [0, 2000]}
      added_mass: {mass: [0, 50]}
      asymmetric_friction: {difference: [-30, 30]}
)";

inline Datasheet axis() {
  const std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("faultline_axis_" + std::to_string(::getpid()));
  std::filesystem::create_directory(folder);
  const std::string file = (folder / "rig.yaml").string();
  std::ofstream(file) << kAxis;
  const Datasheet read = read_datasheet(file);
  std::filesystem::remove_all(folder);
  return read;
}

// Moves and rests under a controller, against dry friction that holds and a load, in steps of 0.1 ms. `asymmetry`: by
// how much friction is larger to plus. `excess`: by how much it is at rest; half of it is gone at 5 mm/s.
inline Recording axis_run(double duration, std::uint64_t seed, double friction, double load, double asymmetry = 0,
                          double excess = 0) {
  constexpr double kPeriod = 0.01, kStep = 1e-4, kMass = 95.1, kViscous = 203.5, kGain = 35.15, kNoise = 1e-7;
  Recording recording;
  recording.rig = "axis";
  recording.channels = axis().channels;
  Random random(seed);
  double x = 0, v = 0, slow = 0, last = 0, wanted = 0, aim = 0, speed = 0.1, until = 0.3;
  for (int k = 0; k * kPeriod < duration; ++k) {
    const double time = k * kPeriod, read = x + kNoise * random.normal();
    if (time >= until && wanted == aim) {
      aim = aim > 0 ? 0 : random.uniform(0.05, 0.24);
      speed = random.uniform(0.08, 0.25);
      until = time + std::abs(aim - wanted) / speed + random.uniform(0.15, 0.5);
    }
    wanted += std::clamp(aim - wanted, -speed * kPeriod, speed * kPeriod);
    slow = 0.3 * slow + 0.7 * (read - last) / kPeriod;
    last = read;
    const double u = std::clamp(22 * (16 * (wanted - read) - slow), -10.0, 10.0);
    recording.time.push_back(time);
    recording.sequence.push_back(static_cast<std::uint64_t>(k));
    recording.values.push_back(u);
    recording.values.push_back(read);
    for (int i = 0; i < 100; ++i) {
      const double free = v + kStep * (kGain * u - load - kViscous * v) / kMass;
      const double slowly = excess / (1 + (v / 5e-3) * (v / 5e-3));
      const double held = kStep * (friction + slowly + std::copysign(0.5 * asymmetry, free)) / kMass;
      const double next = std::abs(free) <= held ? 0 : free - std::copysign(held, free);
      x += kStep * 0.5 * (v + next);
      v = next;
    }
  }
  return recording;
}

}  // namespace faultline
