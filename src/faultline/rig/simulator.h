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
#include <type_traits>
#include <vector>

#include "faultline/numerics/random.h"
#include "faultline/rig/controller.h"
#include "faultline/rig/rig.h"
#include "faultline/signal/sample.h"

namespace faultline {

struct SimulationSetup {
  std::string profile;                 // of the datasheet; empty: its first
  std::vector<double> parameters;      // in the datasheet's order; empty: nominal
  std::vector<EffectSpec> effects;     // on top of the datasheet's nominal effects
  std::vector<CommandTable> commands;  // for commands that no controller moves
  std::uint64_t seed = 1;              // of what differs from run to run; see below
  double substep = 0;                  // s; 0: the rig's own
  double sample_period = 0;            // s, of a driven model's recording; 0: the datasheet's
  bool noise = true;                   // sensor noise and rounding
};

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

// The model driven by what a recording holds: commands and inputs are taken from it, outputs are predicted row by row
// without noise and rounding. At given rows the rig's states may be put back to given values, and the effects of the
// sensors that show them to what they show; other effects on signals keep their memory: the segments of an integrating
// plant.
class DrivenModel {
 public:
  DrivenModel(const Datasheet& sheet, const SimulationSetup& setup);
  DrivenModel(std::shared_ptr<const Datasheet> sheet, const SimulationSetup& setup);  // for many models of one rig
  ~DrivenModel();
  DrivenModel(const DrivenModel&) = delete;
  DrivenModel& operator=(const DrivenModel&) = delete;

  // Predicts rows first .. first + count - 1, one sample period apart. `restarts`: rows (rising, from `first` on) at
  // which the nominal states are set to start_states + i * (number of the datasheet's states); before the first restart
  // the rig's own initial state runs. A restart acts after its row was predicted: the row still shows where the segment
  // before it ended. Calls row(index, channels) with one value per channel for each of them. Effects forget what was
  // before `first`; their time counts from the recording's first row. Where row returns a bool, false ends the run.
  template <class Row>
  void run(const Recording& recording, std::size_t first, std::size_t count, const std::vector<std::size_t>& restarts,
           const double* start_states, Row&& row) {
    begin(recording, first, !restarts.empty() && restarts.front() == first ? start_states : nullptr);
    std::size_t next = !restarts.empty() && restarts.front() == first ? 1 : 0;
    for (std::size_t k = first; k < first + count; ++k) {
      if (k > first) {
        const bool restart = next < restarts.size() && restarts[next] == k;
        advance(recording, k, restart ? start_states + next * state_count() : nullptr);
        next += restart;
      }
      if constexpr (std::is_same_v<decltype(row(k, predicted())), bool>) {
        if (!row(k, predicted())) return;
      } else {
        row(k, predicted());
      }
    }
  }

  // What a channel of the recording shows without its noise `later` s after a row, for sensors whose effects have
  // memory, those of inputs too. Without it they are taken to have stood still.
  using Around = std::function<Shown(const Recording& recording, std::size_t row, std::size_t channel, double later)>;
  void set_around(Around around);

  // Whether effects have memories or states of their own, which a run must first fill.
  bool remembers() const;

  // The rig's states after the last row, in the datasheet's order.
  const double* state() const;
  std::size_t state_count() const;

 private:
  void begin(const Recording& recording, std::size_t row, const double* state);
  void advance(const Recording& recording, std::size_t to_row, const double* state);
  const double* predicted() const;

  struct Parts;
  std::unique_ptr<Parts> parts_;
};

// The datasheet's effects of the nominal model.
std::vector<EffectSpec> nominal_effects(const Datasheet& sheet);
// Integration steps per sample period of the model that a recording drives, with `effects` on top.
int model_substeps(const Datasheet& sheet, const std::vector<EffectSpec>& effects);

// What a transducer shows: with its noise, rounded, within its range; and the generator of a run's noise.
double measured_value(const Channel& channel, double value, Random& noise);
Random sensor_noise(std::uint64_t seed);

// Parameters drawn around nominal with their tolerances (normal, cut at two sigma), for a rig that is off its
// datasheet. Several runs of one rig take the same seed here and other seeds in their setups.
std::vector<double> draw_parameters(const Datasheet& sheet, std::uint64_t seed);

}  // namespace faultline
