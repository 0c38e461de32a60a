// Runs a rig with its effects, sensors and controller, sample by sample.
//
// Row k holds what the sensors say at t_k and the commands issued at t_k, which act until t_{k+1}; where a loop inside
// the rig moves them faster, their mean over that time. A command's noise_std is of its recording. Between samples the
// equations are integrated in equal substeps with the classic fourth-order Runge-Kutta method (Boost.odeint), or, for a
// rig that calls itself stiff, with an L-stable Rosenbrock method; effects on signals are stepped once per substep,
// those at sensors of inputs once per sample. The run starts from the rig's own initial state under the first row's set
// points and commands.
// Deterministic for a given seed. One seed s starts a generator for each purpose, so that none moves with another: the
// first set point s, the second s + 15485863 (command i, from 0, of an open loop s + 15485863 i), measured input i
// (from 0) 7919 s + i + 1 and what moves it 15485863 more, what the controller draws s + 32452843, sensor noise
// 104729 s + 17, effect i a hash of s and i. The rig's own parameters are no part of a run: draw_parameters() has a
// seed of its own.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "faultline/numerics/random.h"
#include "faultline/rig/controller.h"
#include "faultline/rig/rig.h"
#include "faultline/rig/simulation_setup.h"
#include "faultline/signal/sample.h"

namespace faultline {

class Simulator {
 public:
  Simulator(const Datasheet& sheet, const SimulationSetup& setup);
  ~Simulator();
  Simulator(const Simulator&) = delete;
  Simulator& operator=(const Simulator&) = delete;

  void reset();  // back to the first sample; the same rows again
  // The next row, one sample period after the last; the first at time 0. Returns its values, one per channel.
  const Sample& step();

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

// `duration` s from 0, both ends included.
Recording simulate(const Datasheet& sheet, const SimulationSetup& setup, double duration);

// What a transducer shows: with its noise, rounded, within its range; and the generator of a run's noise.
double measured_value(const Channel& channel, double value, Random& noise);
Random sensor_noise(std::uint64_t seed);

// Parameters drawn around nominal with their tolerances (normal, cut at two sigma), for a rig that is off its
// datasheet. Several runs of one rig take the same seed here and other seeds in their setups.
std::vector<double> draw_parameters(const Datasheet& sheet, std::uint64_t seed);

}  // namespace faultline
