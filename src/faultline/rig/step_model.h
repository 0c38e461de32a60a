// A rig's equations from one sample to the next, from any state: what state estimators propagate, as DrivenModel runs
// it (the same parameters, nominal effects, substeps and integrator), with every call by itself.
//
//   state    the datasheet's; states that effects add begin at rest with every step
//   inputs   commands as they reach the plant at the beginning, held; measured inputs run linearly to the end,
//            but one that follows a command is held too: its sample is the mean over the period
//
// Effects on signals that have memory (lag, delay, hysteresis) are followed by prepare(), once per sample in the order
// of time; those of output sensors are undone where they are static (rig/effect.h). A probe that lies outside what the
// equations bear is brought back by their after_step() first (a level below 0). Nothing is allocated after the
// constructor.
#pragma once

#include <memory>
#include <vector>

#include "faultline/rig/datasheet.h"

namespace faultline {

class StepModel {
 public:
  // `parameters` in the datasheet's order; empty: nominal. `beside`: how many advance_all() takes after its first.
  StepModel(const Datasheet& sheet, const std::vector<double>& parameters = {}, int beside = 0);
  ~StepModel();
  StepModel(const StepModel&) = delete;
  StepModel& operator=(const StepModel&) = delete;

  // The rig's own start under these channels (of prepare()); its InputError where it has none.
  void start(const double* plant, double* state);
  // What reaches the plant of a sample's channels: commands through their ports, inputs back through their sensors.
  // `time` in s, rising.
  void prepare(double time, const double* channels, double* plant);
  // `dt` s from `state` under `from` to `to` (of prepare()); into `next`.
  void advance(const double* state, const double* from, const double* to, double dt, double* next);
  // From several states that are near one another, one after the other: all but the first go beside it where they meet
  // no event (numerics/integrator.h), for a fraction of a run of their own.
  void advance_all(const double* states, int count, const double* from, const double* to, double dt, double* next);
  // Output channels at `state`, as they are before their sensors; other channels as they stand in `plant`.
  void outputs(const double* state, const double* plant, double* channels);
  // What an output was before its sensor's static effects; NaN where it says nothing (saturated).
  double undo_sensor(std::size_t channel, double shown, double time) const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace faultline
