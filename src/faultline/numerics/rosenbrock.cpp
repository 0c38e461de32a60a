#include "faultline/numerics/rosenbrock.h"

#include <algorithm>
#include <cmath>

namespace faultline {
namespace {

constexpr double kFirstStep = 1e-5;  // s, of settling
constexpr double kGrowth = 1.6;      // from step to step
constexpr double kLastStep = 1e5;    // s
constexpr double kAtRest = 1e-6;     // of a state's largest value: its last step, which is a Newton step

}  // namespace

Rosenbrock::Rosenbrock(OdeSystem& system)
    : system_(system),
      states_(static_cast<std::size_t>(system.states())),
      lu_(system.states(), system.jacobian_entries()),
      state_(states_),
      stage_(states_),
      rate_(states_),
      time_rate_(states_),
      jacobian_(system.jacobian_entries().size()) {
  for (auto& u : u_) u.resize(states_);
}

void Rosenbrock::step(double time, double dt, const double* inputs) {
  auto& [u1, u2, u3, u4] = u_;
  system_.jacobian(time, state_.data(), inputs, rate_.data(), time_rate_.data(), jacobian_.data());
  lu_.factor(2 / dt, jacobian_.data());
  for (std::size_t s = 0; s < states_; ++s) u1[s] = rate_[s] + 0.5 * dt * time_rate_[s];
  lu_.solve(u1.data());
  for (std::size_t s = 0; s < states_; ++s) {
    u2[s] = rate_[s] + 4 / dt * u1[s] + 1.5 * dt * time_rate_[s];
    stage_[s] = state_[s] + 2 * u1[s];
  }
  lu_.solve(u2.data());
  system_.derivative(time + dt, stage_.data(), inputs, rate_.data());
  for (std::size_t s = 0; s < states_; ++s) u3[s] = rate_[s] + (u1[s] - u2[s]) / dt;
  lu_.solve(u3.data());
  for (std::size_t s = 0; s < states_; ++s) stage_[s] += u3[s];
  system_.derivative(time + dt, stage_.data(), inputs, rate_.data());
  for (std::size_t s = 0; s < states_; ++s) u4[s] = rate_[s] + (u1[s] - u2[s] - 8.0 / 3 * u3[s]) / dt;
  lu_.solve(u4.data());
  for (std::size_t s = 0; s < states_; ++s) state_[s] = stage_[s] + u4[s];
  system_.after_step(time + dt, state_.data(), inputs);
}

std::vector<int> settle(OdeSystem& system, const double* inputs, double* state) {
  const auto states = static_cast<std::size_t>(system.states());
  SparseLu lu(system.states(), system.jacobian_entries());
  std::vector<double> step(states), time_rate(states), jacobian(system.jacobian_entries().size()), largest(states, 0);
  for (double dt = kFirstStep; dt < kLastStep; dt *= kGrowth) {
    system.jacobian(0, state, inputs, step.data(), time_rate.data(), jacobian.data());
    lu.factor(1 / dt, jacobian.data());
    lu.solve(step.data());
    for (std::size_t s = 0; s < states; ++s) {
      state[s] += step[s];
      largest[s] = std::max(largest[s], std::abs(state[s]));
    }
  }
  std::vector<int> moving;
  for (std::size_t s = 0; s < states; ++s)
    if (!(std::abs(step[s]) <= kAtRest * largest[s])) moving.push_back(static_cast<int>(s));  // NaN too
  return moving;
}

}  // namespace faultline
