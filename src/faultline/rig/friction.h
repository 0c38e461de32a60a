// Dry friction with a set-valued standstill, for one body.
//
//   v != 0:  force = level(sgn v) sgn v             v = 0:  force balances the rest, up to the breakaway level
//
// Karnopp's idea: the body has a mode (slipping to +, slipping to -, stuck) that changes only between integration
// steps, so that the equations are smooth within a step. Source: D. Karnopp, "Computer simulation of stick-slip
// friction in mechanical dynamic systems", 1985. A step in which the velocity changes sign ends at v = 0; the error is
// of the order of the step.
#pragma once

namespace faultline {

class DryFriction {
 public:
  void start(double velocity) { mode_ = velocity > 0 ? 1 : velocity < 0 ? -1 : 0; }
  bool stuck() const { return mode_ == 0; }
  int direction() const { return mode_; }

  // Whether a step left the body slipping as it was: after_step() has nothing to do, whatever the forces.
  bool slips_on(double velocity) const { return mode_ != 0 && velocity * mode_ > 0; }

  // Friction force while slipping; levels are magnitudes in N (or N m).
  double force(double level_plus, double level_minus) const {
    return mode_ > 0 ? level_plus : mode_ < 0 ? -level_minus : 0.0;
  }

  // After a step: stops at a reversal; breaks away if the net force of everything else exceeds the breakaway level.
  // What nothing holds goes through zero as it comes.
  void after_step(double& velocity, double net_force, double breakaway_plus, double breakaway_minus) {
    if (velocity != 0 && !(breakaway_plus > 0) && !(breakaway_minus > 0)) return start(velocity);
    if (mode_ != 0 && velocity * mode_ <= 0) {
      mode_ = 0;
      velocity = 0;
    }
    if (mode_ == 0) {
      velocity = 0;
      if (net_force > breakaway_plus) mode_ = 1;
      if (net_force < -breakaway_minus) mode_ = -1;
    }
  }

 private:
  int mode_ = 0;
};

}  // namespace faultline
