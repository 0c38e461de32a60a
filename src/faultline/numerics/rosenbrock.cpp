#include "faultline/numerics/rosenbrock.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include <Eigen/Core>

#include "faultline/numerics/padded_product.h"
#include "faultline/numerics/small_lu.h"
#include "faultline/numerics/sparse_lu.h"

namespace faultline {
namespace {

constexpr double kFirstStep = 1e-5;  // s, of settling
constexpr double kGrowth = 1.6;      // from step to step
constexpr double kLastStep = 1e5;    // s
constexpr double kAtRest = 1e-6;     // of a state's largest value: its last step, which is a Newton step

// As SparseLu, for a matrix of kSize states of which every entry may be there.
template <std::size_t kSize>
class SmallLu {
 public:
  explicit SmallLu(OdeSystem& system) {
    for (const auto& [row, column] : system.jacobian_entries())
      places_.push_back(static_cast<std::size_t>(column) * kSize + static_cast<std::size_t>(row));
  }
  void factor(double diagonal, const double* values) {
    matrix_.fill(0);
    for (std::size_t i = 0; i < kSize; ++i) matrix_[i * kSize + i] = diagonal;
    for (std::size_t i = 0; i < places_.size(); ++i) matrix_[places_[i]] -= values[i];
    std::array<double, kSize * kSize> rows;
    factor_in_place<kSize>(matrix_.data(), order_.data());
    invert<kSize>(matrix_.data(), order_.data(), rows.data());
    inverse_ = Eigen::Map<const Eigen::Matrix<double, kSize, kSize, kSize == 1 ? Eigen::ColMajor : Eigen::RowMajor>>(
        rows.data());
  }
  void solve(double* right_side) const {
    Eigen::Map<Eigen::Matrix<double, kSize, 1>> x(right_side);
    x = (inverse_ * x).eval();
  }
  // W of rosenbrock.h.
  void weigh(double dt) {
    const auto m = (inverse_ / dt).eval();
    weight_ = 8.0 / 3 * m;
    weight_.diagonal().array() -= 20.0 / 3;
    weight_ = (m * weight_).eval();
    weight_.diagonal().array() += 14.0 / 3;
    weight_ = (m * weight_).eval();
    weight_.diagonal().array() += 1;
    weight_ = (inverse_ * weight_).eval();
  }
  void apply_weight(double, double* rate) const {
    Eigen::Map<Eigen::Matrix<double, kSize, 1>> x(rate);
    x = (weight_ * x).eval();
  }

 private:
  std::array<double, kSize * kSize> matrix_{};
  Eigen::Matrix<double, kSize, kSize> inverse_, weight_;
  std::array<int, kSize> order_{};
  std::vector<std::size_t> places_;  // of the entries
};

class AnyLu : public SparseLu {
 public:
  explicit AnyLu(OdeSystem& system)
      : SparseLu(system.states(), system.jacobian_entries()),
        states_(system.states()),
        inverse_(Eigen::MatrixXd::Zero(padded(states_), states_)),
        other_(inverse_),
        weight_(inverse_),
        factor_(states_, states_),
        product_(states_) {}
  // Horner's scheme, each product as X F' with F = m'.
  void weigh(double dt) {
    auto inverse = inverse_.topRows(states_);
    inverse.setIdentity();
    solve(inverse_.data(), static_cast<int>(states_), static_cast<int>(inverse_.rows()));
    factor_ = inverse.transpose() / dt;
    weight_ = 8.0 / (3 * dt) * inverse_;
    weight_.diagonal().array() -= 20.0 / 3;
    multiply_transposed(weight_.data(), factor_.data(), states_, other_.data());
    other_.diagonal().array() += 14.0 / 3;
    multiply_transposed(other_.data(), factor_.data(), states_, weight_.data());
    weight_.diagonal().array() += 1;
    factor_ *= dt;
    multiply_transposed(weight_.data(), factor_.data(), states_, other_.data());
    weight_.swap(other_);
  }
  void apply_weight(double, double* rate) const {
    Eigen::Map<Eigen::VectorXd> x(rate, states_);
    product_.noalias() = weight_.topRows(states_) * x;
    x = product_;
  }

 private:
  Eigen::Index states_;
  Eigen::MatrixXd inverse_, other_, weight_, factor_;  // the first three padded
  mutable Eigen::VectorXd product_;
};

// State: a vector, or an array of as many doubles as there are states.
template <class State, class Lu>
class Rosenbrock : public Integrator {
 public:
  Rosenbrock(OdeSystem& system, const State& zero)
      : system_(system),
        lu_(system),
        state_(zero),
        stage_(zero),
        rate_(zero),
        time_rate_(zero),
        before_(zero),
        u_{zero, zero, zero, zero},
        jacobian_(system.jacobian_entries().size()) {}

  void step(double time, double dt, const double* inputs) override {
    auto& [u1, u2, u3, u4] = u_;
    const std::size_t states = state_.size();
    const double per_step = 1 / dt;
    before_ = state_;
    system_.jacobian(time, state_.data(), inputs, rate_.data(), time_rate_.data(), jacobian_.data());
    lu_.factor(2 / dt, jacobian_.data());
    for (std::size_t s = 0; s < states; ++s) u1[s] = rate_[s] + 0.5 * dt * time_rate_[s];
    lu_.solve(u1.data());
    for (std::size_t s = 0; s < states; ++s) {
      u2[s] = rate_[s] + 4 * per_step * u1[s] + 1.5 * dt * time_rate_[s];
      stage_[s] = state_[s] + 2 * u1[s];
    }
    lu_.solve(u2.data());
    system_.derivative(time + dt, stage_.data(), inputs, rate_.data());
    for (std::size_t s = 0; s < states; ++s) u3[s] = rate_[s] + (u1[s] - u2[s]) * per_step;
    lu_.solve(u3.data());
    for (std::size_t s = 0; s < states; ++s) stage_[s] += u3[s];
    system_.derivative(time + dt, stage_.data(), inputs, rate_.data());
    for (std::size_t s = 0; s < states; ++s) u4[s] = rate_[s] + (u1[s] - u2[s] - 8.0 / 3 * u3[s]) * per_step;
    lu_.solve(u4.data());
    for (std::size_t s = 0; s < states; ++s) state_[s] = stage_[s] + u4[s];
    system_.after_step(time + dt, state_.data(), inputs);
  }
  double* state() override { return state_.data(); }

  // stage_ becomes y_m, rate_ f there. Where f is linear, h f(y_m) is what the step has done, to the last digit.
  bool lead(double time, double dt, const double* inputs) override {
    const auto& [u1, u2, u3, u4] = u_;
    for (std::size_t s = 0; s < state_.size(); ++s)
      stage_[s] = before_[s] + 1.5 * u1[s] - u2[s] / 6 + u3[s] / 3 + 0.5 * u4[s];
    system_.derivative(time + 0.5 * dt, stage_.data(), inputs, rate_.data());
    lu_.weigh(dt);
    return true;
  }
  void step_beside(double time, double dt, const double* inputs, const Integrator& other, Look) override {
    const auto& leader = static_cast<const Rosenbrock&>(other);
    const std::size_t states = state_.size();
    for (std::size_t s = 0; s < states; ++s) {
      state_[s] -= leader.before_[s];
      stage_[s] = leader.stage_[s] + state_[s];
    }
    system_.derivative(time + 0.5 * dt, stage_.data(), inputs, rate_.data());
    for (std::size_t s = 0; s < states; ++s) rate_[s] -= leader.rate_[s];
    leader.lu_.apply_weight(dt, rate_.data());
    for (std::size_t s = 0; s < states; ++s) state_[s] += leader.state_[s] + rate_[s];
    system_.after_step(time + dt, state_.data(), inputs);
  }

 private:
  OdeSystem& system_;
  Lu lu_;
  State state_, stage_, rate_, time_rate_, before_;
  std::array<State, 4> u_;
  std::vector<double> jacobian_;
};

template <int kMost = kFewStates>
std::unique_ptr<Integrator> make_small(OdeSystem& system) {
  using State = std::array<double, kMost>;
  if (system.states() == kMost)
    return std::make_unique<Rosenbrock<State, SmallLu<static_cast<std::size_t>(kMost)>>>(system, State{});
  if constexpr (kMost > 1) return make_small<kMost - 1>(system);
  return nullptr;
}

}  // namespace

std::unique_ptr<Integrator> make_rosenbrock(OdeSystem& system) {
  if (system.states() >= 1 && system.states() <= kFewStates) return make_small(system);
  const std::vector<double> zero(static_cast<std::size_t>(system.states()));
  return std::make_unique<Rosenbrock<std::vector<double>, AnyLu>>(system, zero);
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
