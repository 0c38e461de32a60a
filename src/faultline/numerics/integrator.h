// Fixed-step integration of ordinary differential equations. A system that is not stiff gets the classic fourth-order
// Runge-Kutta method of Boost.odeint, which is explicit: the step must be below 2.7 over its fastest rate. A system
// that calls itself stiff gets a Rosenbrock method (rosenbrock.h). A step allocates nothing.
//
// A system that is nearly another one, f* near f, is integrated beside it: y* = y + d, and over a step of h
//
//   r(d) = f*(t + h/2, y_m + d) - f(t + h/2, y_m)
//   d(t + h) = d + W r(d),   W = h phi(h J),  phi(z) = 1 + z/2 + z^2/6 + ...
//
// y_m: in the middle of the leader's step, d: as at its beginning, J: the leader's Jacobian. An explicit method, whose
// steps are not short against what dry friction switches on and off, looks once more, in the middle of the step:
// d_m = d + h/2 phi(h J/2) r(d), and W (r(d_m) - J (d_m - d)) instead of W r(d). A filter's points, where f* is f and
// d their spread, need no second look.
//
// Exact where both are linear and have the same J; second order in h else, for one or two evaluations of f* and some
// products a step. phi is the one of the leader's method, so that what is stable there is stable here. Where d stays
// small that is how a course changes with parameters, effects and start states; where it comes to rest both methods
// agree. What swings within a step with another J (a quarter of the mass more) may be wrong by half; what friction
// switches within one, by a tenth. Where f jumps at the leader's state (a body at its stop, which moves off it one way
// only) J is no derivative, and nothing goes beside that step.
#pragma once

#include <memory>

#include "faultline/numerics/ode_system.h"

namespace faultline {

enum class Look { once, again };  // of an explicit method

class Integrator {
 public:
  virtual ~Integrator() = default;
  // One step of dt [s] from `time` [s], inputs held.
  virtual void step(double time, double dt, const double* inputs) = 0;
  // As many values as the system has states, 0 at first; written to start from another state.
  virtual double* state() = 0;

  // After a step, before others take it beside this one: whether they may. `inputs` as in step().
  virtual bool lead(double time, double dt, const double* inputs) = 0;
  // The step that `leader`, of the same kind and with as many states, has just led, beside it.
  virtual void step_beside(double time, double dt, const double* inputs, const Integrator& leader, Look look) = 0;
};

// The system must outlive its integrator.
std::unique_ptr<Integrator> make_integrator(OdeSystem& system);

}  // namespace faultline
