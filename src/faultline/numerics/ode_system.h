// A system of ordinary differential equations, d(state)/dt = f(time, state, inputs), as integrators see it; the inputs
// are held over a step. A system that is stiff also gives its Jacobian: without one, jacobian() throws
// std::logic_error.
#pragma once

#include <utility>
#include <vector>

namespace faultline {

class OdeSystem {
 public:
  virtual ~OdeSystem() = default;

  virtual int states() const = 0;
  // d(state)/dt at time [s].
  virtual void derivative(double time, const double* state, const double* inputs, double* rate) = 0;
  // After each step: events and limits (sticking, end of travel, no negative pressure).
  virtual void after_step(double /*time*/, double* /*state*/, const double* /*inputs*/) {}
  // Whether the equations need an implicit method at the steps that will be taken; then the two below are called.
  virtual bool stiff() const { return false; }
  // (row, column) of every non-zero of the Jacobian d(rate)/d(state); always the same.
  virtual const std::vector<std::pair<int, int>>& jacobian_entries() const;
  // As derivative(); also d(rate)/d(time) and the Jacobian's non-zeros, in the order of jacobian_entries().
  virtual void jacobian(double time, const double* state, const double* inputs, double* rate, double* time_rate,
                        double* entries);
};

}  // namespace faultline
