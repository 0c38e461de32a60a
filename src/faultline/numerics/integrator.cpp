#include "faultline/numerics/integrator.h"

#include <vector>

#include <boost/numeric/odeint/stepper/runge_kutta4_classic.hpp>

#include "faultline/numerics/rosenbrock.h"

namespace faultline {
namespace {

class RungeKutta4 : public Integrator {
 public:
  explicit RungeKutta4(OdeSystem& system) : system_(system), state_(static_cast<std::size_t>(system.states())) {
    stepper_.adjust_size(state_);
  }
  void step(double time, double dt, const double* inputs) override {
    stepper_.do_step(
        [this, inputs](const State& x, State& rate, double t) { system_.derivative(t, x.data(), inputs, rate.data()); },
        state_, time, dt);
    system_.after_step(time + dt, state_.data(), inputs);
  }
  double* state() override { return state_.data(); }

 private:
  using State = std::vector<double>;
  OdeSystem& system_;
  State state_;
  boost::numeric::odeint::runge_kutta4_classic<State> stepper_;
};

}  // namespace

std::unique_ptr<Integrator> make_integrator(OdeSystem& system) {
  if (system.stiff()) return std::make_unique<Rosenbrock>(system);
  return std::make_unique<RungeKutta4>(system);
}

}  // namespace faultline
