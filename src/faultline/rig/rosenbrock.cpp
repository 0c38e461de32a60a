#include "faultline/rig/rosenbrock.h"

#include <algorithm>
#include <cmath>

namespace faultline {
namespace {

constexpr double kFirstStep = 1e-5;  // s, of settling
constexpr double kGrowth = 1.6;      // from step to step
constexpr double kLastStep = 1e5;    // s

const double kRos2Gamma = 1 - std::sqrt(0.5);

}  // namespace

const Rosenbrock::Tableau& Rosenbrock::tableau(Scheme scheme) {
  static const Tableau accurate = {4,
                                   0.5,
                                   {0, 0, 1, 1},
                                   {0.5, 1.5, 0, 0},
                                   {2, 0, 1, 1},
                                   {{{}, {}, {2, 0}, {2, 0, 1}}},
                                   {{{}, {4}, {1, -1}, {1, -1, -8.0 / 3}}},
                                   {true, false, true, true}};
  static const Tableau quick = {2,
                                kRos2Gamma,
                                {0, 1},
                                {kRos2Gamma, -kRos2Gamma},
                                {1.5 / kRos2Gamma, 0.5 / kRos2Gamma},
                                {{{}, {1 / kRos2Gamma}}},
                                {{{}, {-2 / kRos2Gamma}}},
                                {true, true}};
  return scheme == Scheme::quick ? quick : accurate;
}

Rosenbrock::Rosenbrock(Rig& rig, Scheme scheme)
    : rig_(rig),
      tableau_(tableau(scheme)),
      states_(static_cast<std::size_t>(rig.states())),
      lu_(rig.states(), rig.jacobian_entries()),
      state_(states_),
      stage_state_(states_),
      rate_(states_),
      time_rate_(states_),
      jacobian_(rig.jacobian_entries().size()) {
  for (auto& u : u_) u.resize(states_);
}

void Rosenbrock::start(const double* channels) {
  std::fill(state_.begin(), state_.end(), 0);
  rig_.start(channels, state_.data());
}

void Rosenbrock::start_at(const double* nominal_state, const double* channels) {
  std::fill(state_.begin(), state_.end(), 0);
  rig_.start_at(nominal_state, channels, state_.data());
}

void Rosenbrock::step(double time, double dt, const double* channels) {
  const Tableau& t = tableau_;
  rig_.jacobian(time, state_.data(), channels, rate_.data(), time_rate_.data(), jacobian_.data());
  lu_.factor(1 / (dt * t.gamma), jacobian_.data());
  for (std::size_t i = 0; i < t.stages; ++i) {
    if (i > 0 && t.new_rate[i]) {
      for (std::size_t s = 0; s < states_; ++s) {
        double y = state_[s];
        for (std::size_t j = 0; j < i; ++j) y += t.a[i][j] * u_[j][s];
        stage_state_[s] = y;
      }
      rig_.derivative(time + t.alpha[i] * dt, stage_state_.data(), channels, rate_.data());
    }
    for (std::size_t s = 0; s < states_; ++s) {
      double right = rate_[s] + t.gammas[i] * dt * time_rate_[s];
      for (std::size_t j = 0; j < i; ++j) right += t.c[i][j] / dt * u_[j][s];
      u_[i][s] = right;
    }
    lu_.solve(u_[i].data());
  }
  for (std::size_t i = 0; i < t.stages; ++i)
    for (std::size_t s = 0; s < states_; ++s) state_[s] += t.weights[i] * u_[i][s];
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
