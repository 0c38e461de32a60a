#include "faultline/numerics/integrator.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <boost/numeric/odeint/algebra/array_algebra.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta4_classic.hpp>

#include "faultline/numerics/rosenbrock.h"

namespace faultline {
namespace {

constexpr int kMostInPlace = 16;  // states up to which the steppers' loops have a length that the compiler knows

// State: a vector, or an array of as many doubles as there are states, kStates.
template <class State, int kStates>
class RungeKutta4 : public Integrator {
 public:
  RungeKutta4(OdeSystem& system, const State& zero)
      : system_(system),
        state_(zero),
        before_(zero),
        middle_(zero),
        rate_(zero),
        probed_(zero),
        sizes_(zero),
        jacobian_(system.states(), system.states()),
        weight_(jacobian_),
        half_weight_(jacobian_),
        square_(jacobian_),
        cube_(jacobian_),
        difference_(system.states()),
        moved_(system.states()) {
    stepper_.adjust_size(state_);
  }
  void step(double time, double dt, const double* inputs) override {
    before_ = state_;
    stepper_.do_step(
        [this, inputs](const State& x, State& rate, double t) { system_.derivative(t, x.data(), inputs, rate.data()); },
        state_, time, dt);
    system_.after_step(time + dt, state_.data(), inputs);
  }
  double* state() override { return state_.data(); }

  bool lead(double time, double dt, const double* inputs) override {
    const std::size_t states = state_.size();
    for (std::size_t s = 0; s < states; ++s) {
      middle_[s] = 0.5 * (before_[s] + state_[s]);
      sizes_[s] = std::max(sizes_[s], std::abs(middle_[s]));
    }
    system_.derivative(time + 0.5 * dt, middle_.data(), inputs, rate_.data());
    for (std::size_t column = 0; column < states; ++column) {
      const auto c = static_cast<Eigen::Index>(column);
      const double step = kDifference * sizes_[column];
      if (step == 0) {  // it has never moved
        jacobian_.col(c).setZero();
        continue;
      }
      const double kept = middle_[column];
      middle_[column] += step;
      system_.derivative(time + 0.5 * dt, middle_.data(), inputs, probed_.data());
      middle_[column] = kept;
      for (std::size_t row = 0; row < states; ++row)
        jacobian_(static_cast<Eigen::Index>(row), c) = (probed_[row] - rate_[row]) / step;
    }
    if (!(jacobian_.diagonal().cwiseAbs().maxCoeff() * dt < kFastest)) return false;
    square_.noalias() = jacobian_ * jacobian_;
    cube_.noalias() = square_ * jacobian_;
    respond(dt, weight_);
    respond(0.5 * dt, half_weight_);
    return true;
  }
  void step_beside(double time, double dt, const double* inputs, const Integrator& other, Look looks) override {
    const auto& leader = static_cast<const RungeKutta4&>(other);
    for (std::size_t s = 0; s < state_.size(); ++s) middle_[s] = leader.middle_[s] + (state_[s] - leader.before_[s]);
    look(time + 0.5 * dt, inputs, leader);
    if (looks == Look::again) {
      moved_.noalias() = leader.half_weight_ * difference_;
      for (std::size_t s = 0; s < state_.size(); ++s) middle_[s] += moved_[static_cast<Eigen::Index>(s)];
      look(time + 0.5 * dt, inputs, leader);
      difference_.noalias() -= leader.jacobian_ * moved_;
    }
    moved_.noalias() = leader.weight_ * difference_;
    for (std::size_t s = 0; s < state_.size(); ++s)
      state_[s] = leader.state_[s] + (state_[s] - leader.before_[s]) + moved_[static_cast<Eigen::Index>(s)];
    system_.after_step(time + dt, state_.data(), inputs);
  }

 private:
  using Matrix = Eigen::Matrix<double, kStates, kStates>;
  using Vector = Eigen::Matrix<double, kStates, 1>;
  static constexpr double kDifference = 1e-6;  // of the largest value that a state had
  static constexpr double kFastest = 3;        // rate times step, a little above what the method is stable for

  // h phi(h J), phi = I + z/2 + z^2/6 + z^3/24.
  void respond(double h, Matrix& weight) const {
    weight = (h * h / 2) * jacobian_ + (h * h * h / 6) * square_ + (h * h * h * h / 24) * cube_;
    weight.diagonal().array() += h;
  }
  // r at middle_.
  void look(double time, const double* inputs, const RungeKutta4& leader) {
    system_.derivative(time, middle_.data(), inputs, rate_.data());
    for (std::size_t s = 0; s < state_.size(); ++s)
      difference_[static_cast<Eigen::Index>(s)] = rate_[s] - leader.rate_[s];
  }

  OdeSystem& system_;
  State state_, before_, middle_, rate_, probed_, sizes_;
  Matrix jacobian_, weight_, half_weight_, square_, cube_;
  Vector difference_, moved_;
  boost::numeric::odeint::runge_kutta4_classic<State> stepper_;
};

template <std::size_t N>
std::unique_ptr<Integrator> make_in_place(OdeSystem& system) {
  return std::make_unique<RungeKutta4<std::array<double, N>, static_cast<int>(N)>>(system, std::array<double, N>{});
}

template <std::size_t... N>
std::unique_ptr<Integrator> make_in_place(OdeSystem& system, std::index_sequence<N...>) {
  using Make = std::unique_ptr<Integrator> (*)(OdeSystem&);
  constexpr std::array<Make, sizeof...(N)> make = {make_in_place<N + 1>...};
  return make[static_cast<std::size_t>(system.states()) - 1](system);
}

}  // namespace

std::unique_ptr<Integrator> make_integrator(OdeSystem& system) {
  if (system.stiff()) return make_rosenbrock(system);
  if (system.states() >= 1 && system.states() <= kMostInPlace)
    return make_in_place(system, std::make_index_sequence<kMostInPlace>());
  const std::vector<double> zero(static_cast<std::size_t>(system.states()));
  return std::make_unique<RungeKutta4<std::vector<double>, Eigen::Dynamic>>(system, zero);
}

}  // namespace faultline
