// The effects of one simulation, by port, in the order in which they were given.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "faultline/rig/datasheet.h"
#include "faultline/rig/effect.h"

namespace faultline {

// Effects at one port, applied one after the other. An empty chain changes nothing.
class EffectChain {
 public:
  void add(Effect* effect) { effects_.push_back(effect); }
  bool empty() const { return effects_.empty(); }
  Passed passed() const { return effects_.empty() ? nothing_passed() : effects_.back()->passed(); }  // the last one

  double signal(double value, double time) const {
    for (Effect* e : effects_) value = e->signal(value, time);
    return value;
  }
  double undo_signal(double value, double time) const {
    for (auto e = effects_.rbegin(); e != effects_.rend(); ++e) value = (*e)->undo_signal(value, time);
    return value;
  }
  bool remembers() const {
    for (const Effect* e : effects_)
      if (e->remembers()) return true;
    return false;
  }
  // What went in at `time`, from what came out around it.
  Shown undo(const Course& out, double time) const {
    Course in = out;
    for (auto e = effects_.rbegin(); e != effects_.rend(); ++e) {
      const Course after = std::move(in);
      in = [effect = *e, after, time](double later) {
        return effect->undo(after, later, time, std::numeric_limits<double>::quiet_NaN());
      };
    }
    return in(0);
  }
  // The same; effects with memory go on from there. `own`: of a model that
  // runs, what goes in. `known`: what goes in, where that is known; else NaN.
  Shown resume(const Course& out, double time, double own, double known) const {
    Course in = out;
    for (auto e = effects_.rbegin(); e != effects_.rend(); ++e) {
      const double mine = e + 1 == effects_.rend() ? own : std::numeric_limits<double>::quiet_NaN();
      const double behind = e + 1 == effects_.rend() ? known : std::numeric_limits<double>::quiet_NaN();
      const Course after = std::move(in);
      in = [effect = *e, after, time, mine, behind](double later) {
        Shown result = effect->undo(after, later, time, mine);
        if (!std::isnan(behind)) result.value = behind;
        return result;
      };
      (*e)->resume(in(0), after(0));
    }
    return in(0);
  }
  BodyForces forces(const Motion& motion) const {
    BodyForces sum;
    for (const Effect* e : effects_) e->force(motion, sum);
    return sum;
  }
  double flow(const LeakPath& path) const {
    double sum = 0;
    for (const Effect* e : effects_) sum += e->flow(path);
    return sum;
  }
  // Of flow(), what the TO side gets.
  double arriving(const LeakPath& path) const {
    double sum = 0;
    for (const Effect* e : effects_) sum += e->arriving_share() * e->flow(path);
    return sum;
  }
  double opening(double value) const {
    for (const Effect* e : effects_) value = e->opening(value);
    return value;
  }
  double edge(double value) const {  // 0: shut
    for (const Effect* e : effects_) value = e->edge(value);
    return std::max(0.0, value);
  }
  double drop(double value) const {
    for (const Effect* e : effects_) value = e->drop(value);
    return value;
  }
  double bulk_modulus(double modulus, double absolute_pressure) const {
    for (const Effect* e : effects_) modulus = e->bulk_modulus(modulus, absolute_pressure);
    return modulus;
  }
  double boundary(double value, double flow, double time) const {
    for (const Effect* e : effects_) value = e->boundary(value, flow, time);
    return value;
  }
  double delivery(double flow, double shaft_angle) const {
    for (const Effect* e : effects_) flow = e->delivery(flow, shaft_angle);
    return flow;
  }
  Viscosity viscosity() const {
    Viscosity sum;
    for (const Effect* e : effects_) e->viscosity(sum);
    return sum;
  }
  Coupling coupling() const {
    Coupling sum;
    for (const Effect* e : effects_) e->coupling(sum);
    return sum;
  }
  Line line() const {
    Line sum;
    for (const Effect* e : effects_) e->line(sum);
    return sum;
  }
  HeatPath heat() const {
    HeatPath sum;
    for (const Effect* e : effects_) e->heat(sum);
    return sum;
  }

 private:
  std::vector<Effect*> effects_;
};

class EffectSet {
 public:
  // `step`: s, time between calls at signal ports; `input_step`: at sensors of inputs, 0: the same. InputError where
  // the rig has no such port or the effect does not fit it.
  EffectSet(const Datasheet& sheet, const std::vector<EffectSpec>& specs, double step, std::uint64_t seed,
            double input_step = 0);
  EffectSet(const EffectSet&) = delete;
  EffectSet& operator=(const EffectSet&) = delete;

  const EffectChain& at(const std::string& port) const;  // empty chain where nothing sits
  void set_time(double time);                            // grows what grows
  void reset();                                          // clears all memory
  bool remembers() const;                                // whether any has one
  bool remembers_inside() const;                         // and acts in the equations, not on a signal

 private:
  std::vector<EffectSpec> specs_;
  std::vector<std::unique_ptr<Effect>> effects_;
  std::map<std::string, EffectChain> chains_;
  EffectChain none_;
  std::shared_ptr<std::set<std::string>> asked_;  // the datasheet's
};

// Throws InputError unless the effect fits the port on this rig.
void check_effect(const Datasheet& sheet, const EffectSpec& spec);

}  // namespace faultline
