// A rig: the equations of one nominal model, with the ports where effects sit. A rig's own file in rigs/ derives from
// Rig and registers itself under the name of its datasheet. What rigs share (ports on signals, sampling, integration)
// is the simulator's.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "faultline/numerics/ode_system.h"
#include "faultline/rig/effect_chain.h"
#include "faultline/signal/registry.h"

namespace faultline {

// The number of states depends on the effects (a pipe with inertia has a flow); the datasheet's states come first, in
// its order, those of effects after them. The inputs of the equations are all
// channels, with commands and inputs as they reach the plant.
class Rig : public OdeSystem {
 public:
  // Initial state for the given channel values; sets all discrete modes. `channels`: one value per channel.
  virtual void start(const double* channels, double* state) = 0;
  // After start(), where a recording drives the model: states that no input sets there, as the temperature of water
  // that stands, are what the outputs show. `shown`: of an output's channel, back through its sensor's effects; NaN
  // where nothing is known.
  virtual void start_as_shown(const std::function<double(int channel)>& /*shown*/, double* /*state*/) {}
  // Takes a given nominal state (in the datasheet's order) instead of the initial one; effect states start at rest.
  // Sets no modes.
  virtual void start_at(const double* nominal_state, const double* channels, double* state) = 0;
  // Sets all discrete modes (slipping, sticking) as the state says.
  virtual void set_modes(const double* /*state*/) {}
  // Which discrete modes the motion is in, as a number; kUneven: it may change within the next step, or what acts is
  // fast. A step that begins and ends in the same other one met no event.
  static constexpr int kUneven = -1;
  virtual int motion(const double* /*state*/) const { return kUneven; }
  // Writes the output channels (and inputs that the model predicts) into `channels`, before sensors.
  virtual void outputs(double time, const double* state, double* channels) const = 0;
  // Flow drawn from the source that the measured input `channel` shows, m^3/s: what its pressure falls with, where the
  // datasheet says so.
  virtual double drawn(int /*channel*/, double /*time*/, const double* /*state*/, const double* /*channels*/) const {
    return 0;
  }
  // A state of an effect that is the integral of an input since the recording began, as the angle of a shaft that is
  // not measured. `state`: its place.
  struct Integral {
    std::size_t state, channel;
  };
  virtual std::vector<Integral> integrals() const { return {}; }
};

struct RigType {
  static constexpr const char* kKind = "rig";
  std::string name;
  double substep;  // s, at which the integration has converged
  // `parameters` in the datasheet's order. Keeps references to the effects' chains: they must outlive the rig.
  std::unique_ptr<Rig> (*make)(const Datasheet& sheet, const std::vector<double>& parameters, const EffectSet& effects);
  // s, of the model that a recording drives, which may be coarser; 0: substep.
  double model_substep = 0;
  // s, of the model where its motion() stays what it is and long steps are asked for (SimulationSetup): events, not the
  // equations between them, need model_substep. 0: no longer steps anywhere.
  double even_substep = 0;
  // s, of the model with effects that bring states faster than the rig's own; 0: substep.
  double fast_substep = 0;
  // Which do; null: all in a line, and in a transmission all but a scale.
  bool (*is_fast)(const EffectSpec& effect) = nullptr;
  // s, of the same where SimulationSetup::rough is asked for; 0: fast_substep.
  double rough_fast_substep = 0;
  // s, between which its channels show nothing new: readings may be averaged over it. 0: each sample may.
  double shown_period = 0;
};

inline const Registry<RigType>::Types& rig_types() { return registry<RigType>().all(); }
inline const RigType* find_rig_type(const std::string& name) { return registry<RigType>().find(name); }

// InputError unless the datasheet's states bear these names in this order: the equations know them by their place.
void check_state_names(const Datasheet& sheet, const std::vector<std::string>& names);

template <class T>
std::unique_ptr<Rig> make_rig(const Datasheet& sheet, const std::vector<double>& parameters, const EffectSet& effects) {
  return std::make_unique<T>(sheet, parameters, effects);
}

}  // namespace faultline

#define FAULTLINE_RIG(name, ...) FAULTLINE_REGISTER(RigType, name, __VA_ARGS__)
