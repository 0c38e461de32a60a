// Fixed-step integration of ordinary differential equations. A system that is not stiff gets the classic fourth-order
// Runge-Kutta method of Boost.odeint, which is explicit: the step must be below 2.7 over its fastest rate. A system
// that calls itself stiff gets a Rosenbrock method (rosenbrock.h). A step allocates nothing.
#pragma once

#include <memory>

#include "faultline/numerics/ode_system.h"

namespace faultline {

class Integrator {
 public:
  virtual ~Integrator() = default;
  // One step of dt [s] from `time` [s], inputs held.
  virtual void step(double time, double dt, const double* inputs) = 0;
  // As many values as the system has states, 0 at first; written to start from another state.
  virtual double* state() = 0;

  // A step of a system that is nearly another's, beside it: by the Jacobian of the step that the other has just taken
  // (rosenbrock.h). Of methods that have one; others throw std::logic_error.
  virtual bool leads() const { return false; }
  // After a step, before others take it beside this one.
  virtual void lead(double time, double dt, const double* inputs);
  // `leader`: of the same kind, with as many states, which has taken this step and leads.
  virtual void step_beside(double time, double dt, const double* inputs, const Integrator& leader);
};

// The system must outlive its integrator.
std::unique_ptr<Integrator> make_integrator(OdeSystem& system);

}  // namespace faultline
