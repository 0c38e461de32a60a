#include "faultline/numerics/integrator.h"

#include <array>
#include <stdexcept>
#include <utility>
#include <vector>

#include <boost/numeric/odeint/algebra/array_algebra.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta4_classic.hpp>

#include "faultline/numerics/rosenbrock.h"

namespace faultline {
namespace {

constexpr int kMostInPlace = 16;  // states up to which the steppers' loops have a length that the compiler knows

// State: a vector, or an array of as many doubles as there are states.
template <class State>
class RungeKutta4 : public Integrator {
 public:
  RungeKutta4(OdeSystem& system, const State& zero) : system_(system), state_(zero) { stepper_.adjust_size(state_); }
  void step(double time, double dt, const double* inputs) override {
    stepper_.do_step(
        [this, inputs](const State& x, State& rate, double t) { system_.derivative(t, x.data(), inputs, rate.data()); },
        state_, time, dt);
    system_.after_step(time + dt, state_.data(), inputs);
  }
  double* state() override { return state_.data(); }

 private:
  OdeSystem& system_;
  State state_;
  boost::numeric::odeint::runge_kutta4_classic<State> stepper_;
};

template <std::size_t N>
std::unique_ptr<Integrator> make_in_place(OdeSystem& system) {
  return std::make_unique<RungeKutta4<std::array<double, N>>>(system, std::array<double, N>{});
}

template <std::size_t... N>
std::unique_ptr<Integrator> make_in_place(OdeSystem& system, std::index_sequence<N...>) {
  using Make = std::unique_ptr<Integrator> (*)(OdeSystem&);
  constexpr std::array<Make, sizeof...(N)> make = {make_in_place<N + 1>...};
  return make[static_cast<std::size_t>(system.states()) - 1](system);
}

}  // namespace

void Integrator::lead(double, double, const double*) { throw std::logic_error("this method leads no other"); }
void Integrator::step_beside(double, double, const double*, const Integrator&) {
  throw std::logic_error("this method goes beside no other");
}

std::unique_ptr<Integrator> make_integrator(OdeSystem& system) {
  if (system.stiff()) return make_rosenbrock(system);
  if (system.states() >= 1 && system.states() <= kMostInPlace)
    return make_in_place(system, std::make_index_sequence<kMostInPlace>());
  const std::vector<double> zero(static_cast<std::size_t>(system.states()));
  return std::make_unique<RungeKutta4<std::vector<double>>>(system, zero);
}

}  // namespace faultline
