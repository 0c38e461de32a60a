// An effect sits at a port and changes what passes through it. One class serves simulating, injecting, estimating,
// diagnosing and closing the gap.
//
// Every effect has bounded parameters with units and a value at which it changes nothing. It may start at a time and
// grow: from `from` to `to` its size rises linearly from nothing to the full parameters (a step where `to` is `from` or
// not given; `to` before `from` is refused).
// With `swells` it comes and goes that many times between `from` and `to`, as (1 - cos)/2, and is gone before and
// after. A parameter whose no-effect value is infinite grows as 1/size; one without a no-effect value (a shape) keeps
// its value. A shape may have a usual value, which it has where none is given.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "faultline/rig/port.h"
#include "faultline/signal/registry.h"

namespace faultline {

constexpr int kMaximumEffectParameters = 12;

struct EffectParameter {
  std::string name;
  std::string unit;  // of the port's quantity where it depends on it: "port"
  double none;       // value at which nothing changes; NaN: a shape parameter, which alone changes nothing
  double minimum;    // what physics allows; a port may narrow it
  double maximum;
  double usual = std::numeric_limits<double>::quiet_NaN();  // of a shape, where none is given; NaN: it must be given
};

bool is_shape(const EffectParameter& parameter);
// No effect; of a shape its usual value.
double not_given(const EffectParameter& parameter);

// Where an effect works: what it may need to know of its port.
struct PortContext {
  double range = 1;          // full scale of what passes, for curves
  double noise_std = 0;      // of the channel, for signal ports
  double step = 1e-3;        // s, time between calls of signal()
  double transition = 1e3;   // pressure drop below which leaks turn laminar: Pa, or the port's drop_unit
  std::uint64_t seed = 0;    // for effects that draw random numbers
  bool only_scaled = false;  // heat: the datasheet lists nothing there that leaves or takes heat, only a factor of it
  // s, when the effect starts to grow; NaN: it does not grow, it is there from time 0 at the size that is set.
  double start = std::numeric_limits<double>::quiet_NaN();
};

// What shows at a place at a time: value, slope per second, and the standard deviations of both.
struct Shown {
  double value = 0, slope = 0, slope_std = 0, std = 0;
};
// What shows there `later` s after a time, before it where negative. NaN: not known.
using Course = std::function<Shown(double later)>;

class Effect {
 public:
  virtual ~Effect() = default;

  // Full-size parameters in the order of the type's list, and the port's context. Clears all memory. Size becomes full.
  void configure(const std::vector<double>& parameters, const std::vector<double>& none, const PortContext& context);
  // Size between nothing (0) and the full parameters (1).
  void set_size(double size);
  double size() const { return size_; }

  virtual void reset() {}  // clears memory; complete

  // Signal at a command or sensor port: called once per step of context().step, in order of time [s].
  virtual double signal(double value, double /*time*/) { return value; }
  // What must have gone in, for the given thing to come out: for sensors whose reading drives the model. Static effects
  // only. NaN: what comes out says nothing about it.
  virtual double undo_signal(double value, double /*time*/) const { return value; }
  // The same `later` s after `time` for any effect, from what comes out around `time`. `own`: what goes in as a model
  // has it; NaN where none does. Here: of a static effect.
  virtual Shown undo(const Course& out, double later, double time, double own) const;
  // Whether what comes out depends on what went in before.
  virtual bool remembers() const { return false; }
  // Sets the memory to that of an effect in which `in` goes while `out` comes out.
  virtual void resume(const Shown& /*in*/, const Shown& /*out*/) {}
  // Whether the values of both say all of that memory: as a state of the rig would, beside the one that goes in.
  virtual bool resumes_by_values() const { return false; }
  virtual void force(const Motion&, BodyForces&) const {}
  virtual double flow(const LeakPath&) const { return 0; }  // m^3/s, added
  virtual double arriving_share() const { return 1; }       // of flow(), at the port's TO side
  virtual double opening(double opening) const { return opening; }
  // One metering edge of a valve, open where positive: the other one is edge(-opening), and opening() what they differ
  // by.
  virtual double edge(double opening) const { return this->opening(opening); }
  // The pressure difference of which a restriction takes the root.
  virtual double drop(double pressure_drop) const { return pressure_drop; }
  virtual double bulk_modulus(double modulus, double /*absolute_pressure*/) const { return modulus; }  // Pa
  virtual double boundary(double value, double /*flow*/, double /*time*/) const { return value; }
  virtual double delivery(double flow, double /*shaft_angle*/) const { return flow; }  // pump flow, m^3/s
  virtual void viscosity(Viscosity&) const {}
  virtual void coupling(Coupling&) const {}
  virtual void line(Line&) const {}
  virtual void heat(HeatPath&) const {}
  // What passed last, as passing() of the port's kind lists it, where an effect takes note (free_signal); else NaN.
  virtual Passed passed() const { return nothing_passed(); }

 protected:
  double parameter(int index) const { return now_[static_cast<std::size_t>(index)]; }
  const PortContext& context() const { return context_; }
  virtual void parameters_changed() {}  // after configure and set_size: recompute what depends on parameters

 private:
  std::array<double, kMaximumEffectParameters> full_{}, none_{}, now_{};
  PortContext context_;
  double size_ = 1;
};

struct EffectType {
  static constexpr const char* kKind = "effect";
  std::string name;
  std::string family;
  std::string meaning;  // the formula, in one line that names every parameter; u: what passes the port
  std::vector<PortKind> fits;
  std::vector<EffectParameter> parameters;
  std::unique_ptr<Effect> (*make)();

  bool fits_kind(PortKind kind) const;
  int parameter_index(const std::string& name) const;  // -1 if there is none
  // Where the first parameter in that unit stands: a frequency in Hz, a phase in rad. parameters.size(): nowhere.
  std::size_t with_unit(const std::string& unit) const;
};

// All effect types, sorted by name. Each effect's file adds its own with FAULTLINE_EFFECT.
inline const Registry<EffectType>::Types& effect_types() { return registry<EffectType>().all(); }
inline const EffectType* find_effect_type(const std::string& name) { return registry<EffectType>().find(name); }

template <class T>
std::unique_ptr<Effect> make_effect() {
  return std::make_unique<T>();
}

constexpr double kNoShape = std::numeric_limits<double>::quiet_NaN();  // `none` of a shape parameter
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// An effect as it is asked for: effect@port:name=value,...[,from=S][,to=S][,swells=N]
struct EffectSpec {
  std::string effect;
  std::string port;
  std::vector<double> parameters;  // in the type's order
  double from = 0;                 // s; grows from here ...
  double to = 0;                   // ... to here
  int swells = 0;                  // 0: it stays once it has grown
  bool from_given = false;
};

// Throws InputError that names what is unknown or missing, and what is allowed.
EffectSpec parse_effect(const std::string& text);
std::string to_string(const EffectSpec& spec);
double growth(const EffectSpec& spec, double time);  // size in 0..1 at `time`

}  // namespace faultline

#define FAULTLINE_EFFECT(name, ...) FAULTLINE_REGISTER(EffectType, name, __VA_ARGS__)
