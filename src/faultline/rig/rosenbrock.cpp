#include "faultline/rig/rosenbrock.h"

#include <algorithm>

namespace faultline {
namespace {

constexpr double kFirstStep = 1e-5;  // s, of settling
constexpr double kGrowth = 1.6;      // from step to step
constexpr double kLastStep = 1e5;    // s

}  // namespace

Rosenbrock::Rosenbrock(Rig& rig)
    : rig_(rig),
      states_(static_cast<std::size_t>(rig.states())),
      lu_(rig.states(), rig.jacobian_entries()),
      state_(states_),
      stage_(states_),
      rate_(states_),
      time_rate_(states_),
      jacobian_(rig.jacobian_entries().size()) {
  for (auto& u : u_) u.resize(states_);
}

void Rosenbrock::start(const double* channels) {
  std::fill(state_.begin(), state_.end(), 0);
  rig_.start(channels, state_.data());
}

void Rosenbrock::move_to(const double* nominal_state, const double* channels) {
  std::fill(rate_.begin(), rate_.end(), 0);
  std::fill(stage_.begin(), stage_.end(), 0);
  rig_.start_at(state_.data(), channels, rate_.data());  // the rest where it stands
  rig_.start_at(nominal_state, channels, stage_.data());
  for (std::size_t s = 0; s < states_; ++s) state_[s] = stage_[s] + (state_[s] - rate_[s]);
  rig_.set_modes(state_.data());
}

void Rosenbrock::step(double time, double dt, const double* channels) {
  auto& [u1, u2, u3, u4] = u_;
  rig_.jacobian(time, state_.data(), channels, rate_.data(), time_rate_.data(), jacobian_.data());
  lu_.factor(2 / dt, jacobian_.data());
  for (std::size_t s = 0; s < states_; ++s) u1[s] = rate_[s] + 0.5 * dt * time_rate_[s];
  lu_.solve(u1.data());
  for (std::size_t s = 0; s < states_; ++s) {
    u2[s] = rate_[s] + 4 / dt * u1[s] + 1.5 * dt * time_rate_[s];
    stage_[s] = state_[s] + 2 * u1[s];
  }
  lu_.solve(u2.data());
  rig_.derivative(time + dt, stage_.data(), channels, rate_.data());
  for (std::size_t s = 0; s < states_; ++s) u3[s] = rate_[s] + (u1[s] - u2[s]) / dt;
  lu_.solve(u3.data());
  for (std::size_t s = 0; s < states_; ++s) stage_[s] += u3[s];
  rig_.derivative(time + dt, stage_.data(), channels, rate_.data());
  for (std::size_t s = 0; s < states_; ++s) u4[s] = rate_[s] + (u1[s] - u2[s] - 8.0 / 3 * u3[s]) / dt;
  lu_.solve(u4.data());
  for (std::size_t s = 0; s < states_; ++s) state_[s] = stage_[s] + u4[s];
  rig_.after_step(time + dt, state_.data(), channels);
}

void settle(Rig& rig, const double* channels, double* state) {
  const auto states = static_cast<std::size_t>(rig.states());
  SparseLu lu(rig.states(), rig.jacobian_entries());
  std::vector<double> step(states), time_rate(states), jacobian(rig.jacobian_entries().size());
  for (double dt = kFirstStep; dt < kLastStep; dt *= kGrowth) {
    rig.jacobian(0, state, channels, step.data(), time_rate.data(), jacobian.data());
    lu.factor(1 / dt, jacobian.data());
    lu.solve(step.data());
    for (std::size_t s = 0; s < states; ++s) state[s] += step[s];
  }
}

}  // namespace faultline
