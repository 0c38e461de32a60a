// Free signal: what passes a port, plus or times what nothing explains.
//
// value: added to signals, boundary values [of what passes], forces against the motion [N, N m], flows [m^3/s] and heat
// to ambient [W/K]; a fraction added to openings, moduli and what is handed on (times 1 + value), and to a heat flux
// where the datasheet lists nothing but its scale. Linear; at a sensor undone exactly. No rig is said to have it: the
// gap diagnoser reconstructs the value over time that would close a gap at a place (gap/stochastic_model.h), so no
// datasheet lists it.

#include "faultline/rig/effect.h"

namespace faultline {
namespace {

class FreeSignal : public Effect {
 public:
  double signal(double value, double /*time*/) override { return note(value), value + parameter(0); }
  double undo_signal(double value, double /*time*/) const override {
    note(value - parameter(0));
    return value - parameter(0);
  }
  double boundary(double value, double flow, double /*time*/) const override {
    note(value, flow);
    return value + parameter(0);
  }
  void force(const Motion& motion, BodyForces& forces) const override {
    note(motion.position, motion.velocity, motion.load);
    forces.applied += parameter(0);
  }
  double flow(const LeakPath& path) const override {
    note(path.pressure_drop, path.upstream, path.shaft_speed);
    return parameter(0);
  }
  double opening(double opening) const override { return note(opening), opening * (1 + parameter(0)); }
  double bulk_modulus(double modulus, double absolute_pressure) const override {
    return note(absolute_pressure), modulus * (1 + parameter(0));
  }
  double delivery(double flow, double shaft_angle) const override {
    return note(flow, shaft_angle), flow * (1 + parameter(0));
  }
  void coupling(Coupling& coupling) const override { coupling.factor += parameter(0); }
  void heat(HeatPath& path) const override {
    if (context().only_scaled)
      path.factor *= 1 + parameter(0);
    else
      path.loss += parameter(0);
  }
  Passed passed() const override { return passed_; }

 private:
  void note(double first, double second = kNoShape, double third = kNoShape) const { passed_ = {first, second, third}; }

  mutable Passed passed_ = nothing_passed();  // an effect serves one simulation, which runs on one thread
};

}  // namespace

FAULTLINE_EFFECT(free_signal,
                 {"free_signal",
                  "free",
                  "u + value; of an opening, a modulus, what is handed on: u (1 + value)",
                  {PortKind::command, PortKind::sensor, PortKind::force, PortKind::flow, PortKind::restriction,
                   PortKind::compliance, PortKind::source, PortKind::transmission, PortKind::heat},
                  {{"value", "port", 0, -1e12, 1e12}},
                  &make_effect<FreeSignal>});

}  // namespace faultline
