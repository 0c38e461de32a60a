// Fixed-step integration of a rig's equations: classic fourth-order Runge-Kutta from Boost.odeint on a padded array, so that
// nothing is allocated and the loops unroll. Explicit: the step must be below 2.7 over the fastest rate of the rig. Rigs that
// call themselves stiff get a Rosenbrock method (rosenbrock.h).
#pragma once

#include <array>
#include <memory>

#include <boost/numeric/odeint/stepper/runge_kutta4_classic.hpp>

#include "faultline/rig/rig.h"

namespace faultline {

class Integrator {
 public:
  virtual ~Integrator() = default;
  virtual void start(const double* channels) = 0;
  // Moves to a nominal state. What effects add keeps its distance to rest: a load stays at the flank of the play on which it was.
  virtual void move_to(const double* nominal_state, const double* channels) = 0;
  // One step of dt [s] from `time` [s], channels held.
  virtual void step(double time, double dt, const double* channels) = 0;
  virtual const double* state() const = 0;
};

template <std::size_t N>
class RungeKutta4 : public Integrator {
 public:
  explicit RungeKutta4(Rig& rig) : rig_(rig) {}
  void start(const double* channels) override {
    state_.fill(0);
    rig_.start(channels, state_.data());
  }
  void move_to(const double* nominal_state, const double* channels) override {
    State rest{}, moved{};
    rig_.start_at(state_.data(), channels, rest.data());
    rig_.start_at(nominal_state, channels, moved.data());
    for (std::size_t i = 0; i < N; ++i) state_[i] = moved[i] + (state_[i] - rest[i]);
    rig_.set_modes(state_.data());
  }
  void step(double time, double dt, const double* channels) override {
    stepper_.do_step(
        [this, channels](const State& x, State& rate, double t) {
          rate.fill(0);  // of the padding too: what stands there by chance slows every step
          rig_.derivative(t, x.data(), channels, rate.data());
        },
        state_, time, dt);
    rig_.after_step(time + dt, state_.data(), channels);
  }
  const double* state() const override { return state_.data(); }

 private:
  using State = std::array<double, N>;
  Rig& rig_;
  State state_{};
  boost::numeric::odeint::runge_kutta4_classic<State> stepper_;
};

std::unique_ptr<Integrator> make_integrator(Rig& rig);

}  // namespace faultline
