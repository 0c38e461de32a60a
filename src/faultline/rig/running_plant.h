// A rig with its effects, and the effects on its signals by channel, integrated from sample to sample: what driven
// (driven_model.h) and closed-loop simulation (simulator.h) share.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "faultline/numerics/integrator.h"
#include "faultline/rig/effect_chain.h"
#include "faultline/rig/rig.h"
#include "faultline/rig/simulation_setup.h"
#include "faultline/signal/sample.h"

namespace faultline {

enum class Use { simulator, model };  // a rig's stand-in, or the model that a recording drives: which substep

// What a recording shows of a channel around a row.
using CourseOf = std::function<Shown(std::size_t channel, double later)>;

class RunningPlant {
 public:
  // A sample period may be run in as many `parts`.
  RunningPlant(const Datasheet& sheet, const SimulationSetup& setup, Use use, int parts = 1);

  // `channels`: commands and inputs at this time. Afterwards seen() holds what the sensors show.
  void start(double time, const double* channels, const double* nominal_state, const double* hidden,
             const CourseOf& around);

  // Puts the rig's states back; what sensors show at this time stays as it was. A state that is NaN goes on; where its
  // channel stands at an end of the range, and no effect at it, from that end or beyond. A state that a channel shows
  // is what that channel says, back through its sensor's effects, which go on from there; other effects keep their
  // memory. `hidden`: of each state what is behind such an effect, then states that effects added, as what they are off
  // from rest at the rig's states, where that is known beside what is shown; NaN, or null: as effects undo it, and as
  // they are. `running`: whether the states until now are worth anything.
  void restart(double time, const double* channels, const double* nominal_state, const double* hidden,
               const CourseOf& around, bool running);

  // Where the integrals of inputs (Rig::integrals()) are at a row, of what the recording shows of these.
  void integrate_inputs(const Recording& recording, std::size_t row);

  // States that effects added; and what they are off from rest at the rig's states.
  std::size_t added() const { return static_cast<std::size_t>(rig_->states()) - sheet_.states.size(); }
  void read_added(const double* channels, double* off);

  // What inputs that follow a command do over the period from `time` on: seen() shows their mean, as their sensors do.
  // To be called once per period, before advance().
  void follow(double time, const double* channels);

  // One sample period from `time`, or one part of it: commands held, inputs run linearly from `now` to `next`; one that
  // follows a command has its mean over the period in the period's first row, and is held where a recording gives it.
  void advance(double time, const double* now, const double* next, int part = 0);

  // Others that differ from this one by a little and go the same way at the same time: beside it (integrator.h), for a
  // fraction of a run of their own; by an explicit method where neither meets an event. `now`, `next`: theirs.
  struct Beside {
    RunningPlant* plant;
    const double *now, *next;
    bool alike;  // moves_as() the one that leads: its states are those
  };
  void advance(double time, const double* now, const double* next, const std::vector<Beside>& beside);
  // Only where no effect in the equations has a memory or states of its own, and both take the same steps: implicit
  // ones, or long ones where that is asked for.
  bool goes_beside(const RunningPlant& leader) const;
  // Whether it differs in what sensors of outputs show alone, and no start is read from what they show. From the same
  // starts its states are the leader's.
  bool moves_as(const RunningPlant& leader) const;

  // What a command's effects with memory were given before a start. After start().
  void remember(std::size_t command, double value, double time);

  const std::vector<double>& seen() const { return shown_; }
  const std::vector<std::pair<std::size_t, const EffectChain*>>& input_sensors() const { return inputs_; }
  const double* state() const { return integrator_->state(); }
  void outputs(double time, double* channels) const { rig_->outputs(time, integrator_->state(), channels); }
  double drawn(int channel, double time) const {
    return rig_->drawn(channel, time, integrator_->state(), true_.data());
  }
  bool remembers() const {
    return effects_.remembers() || static_cast<std::size_t>(rig_->states()) > sheet_.states.size();
  }
  Passed passed(const std::string& port) const { return effects_.at(port).passed(); }
  double period() const { return period_; }

 private:
  double within_reading(std::size_t state, const double* channels) const;  // of one that goes on
  // Rig::start_as_shown()
  double shown_at_start(int channel, double time, const double* channels, const CourseOf& around) const;
  // What effects add to the state keeps its distance to rest: a load stays at the flank of the play on which it was.
  void move_to(const double* nominal_state, const double* channels, const double* added);

  // What drives the equations in substeps `first` .. `first + count - 1` of the period.
  void drive(const double* now, const double* next, int first, int count);
  // What commands with effects are in these substeps, before any is taken: what is tried twice asks no effect twice.
  void take_commands(double time, const double* now, int first, int last);
  // These as one step.
  void step(double time, const double* now, const double* next, int first, int count);
  // The same for a long one; false, and nothing has happened, where there may be an event in it.
  bool step_evenly(double time, const double* now, const double* next, int first);
  // The same beside one that was in this `motion`.
  bool step_beside(double time, const double* now, const double* next, int first, int count, int motion,
                   const Integrator& leader);
  // A long or a short one from substep `first`, before `last`: how many substeps it was.
  int take_step(double time, const double* now, const double* next, int first, int last);
  void take_steps(double time, const double* now, const double* next, int first, int last);

  // Outputs as they are, then as sensors with effects show them, after a step of so many substeps: one that remembers
  // sees them run linearly from where they were before it.
  void observe(double time, int count);

  int longest_even_step(const RigType& type, const SimulationSetup& setup) const;  // in substeps

  struct Command {  // with effects
    std::size_t channel;
    const EffectChain* chain;
    std::vector<double> values;  // per substep of the period
  };
  struct Sensor {  // of an output, with effects
    std::size_t channel;
    const EffectChain* chain;
    bool remembers;
    double before;  // the output at the last row or step, or where a restart put it
  };

  struct Follower {  // an input that the model predicts from a command
    std::size_t input, command;
    const EffectChain *drive, *sensor;  // null: nothing sits there
    std::vector<double> values;         // of the input, per substep of the period
  };

  const Datasheet& sheet_;
  Use use_;
  double period_;  // s
  int parts_, substeps_;
  double substep_;
  EffectSet effects_;
  int even_ = 1;          // substeps of a long step
  bool beside_;           // SimulationSetup
  std::string moved_by_;  // all that the motion depends on; empty: what sensors show as well
  std::unique_ptr<Rig> rig_;
  std::unique_ptr<Integrator> integrator_;
  std::vector<std::pair<std::size_t, const EffectChain*>> inputs_;
  std::vector<Command> commands_;
  std::vector<Sensor> sensors_;
  std::vector<std::pair<std::size_t, const EffectChain*>> shown_states_;
  std::vector<std::size_t> run_, held_;  // channels: inputs, commands
  std::vector<Follower> followers_;
  std::vector<double> true_, shown_, plain_, start_, rest_, moved_, before_;
  std::vector<double> resumed_;  // per channel: what its sensor shows at a start; NaN: what its effects make of it
};

}  // namespace faultline
