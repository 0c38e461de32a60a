// Fixed-step integration of ordinary differential equations: classic fourth-order Runge-Kutta from Boost.odeint on a padded array,
// so that nothing is allocated and the loops unroll. Explicit: the step must be below 2.7 over the fastest rate of the system. A
// system that calls itself stiff gets a Rosenbrock method (rosenbrock.h).
#pragma once

#include <array>
#include <memory>

#include <boost/numeric/odeint/stepper/runge_kutta4_classic.hpp>

#include "faultline/numerics/ode_system.h"

namespace faultline {

class Integrator {
 public:
  virtual ~Integrator() = default;
  // One step of dt [s] from `time` [s], inputs held.
  virtual void step(double time, double dt, const double* inputs) = 0;
  // As many values as the system has states, 0 at first; written to start from another state.
  virtual double* state() = 0;
};

template <std::size_t N>
class RungeKutta4 : public Integrator {
 public:
  explicit RungeKutta4(OdeSystem& system) : system_(system) {}
  void step(double time, double dt, const double* inputs) override {
    stepper_.do_step(
        [this, inputs](const State& x, State& rate, double t) {
          rate.fill(0);  // of the padding too: what stands there by chance slows every step
          system_.derivative(t, x.data(), inputs, rate.data());
        },
        state_, time, dt);
    system_.after_step(time + dt, state_.data(), inputs);
  }
  double* state() override { return state_.data(); }

 private:
  using State = std::array<double, N>;
  OdeSystem& system_;
  State state_{};
  boost::numeric::odeint::runge_kutta4_classic<State> stepper_;
};

std::unique_ptr<Integrator> make_integrator(OdeSystem& system);

}  // namespace faultline
