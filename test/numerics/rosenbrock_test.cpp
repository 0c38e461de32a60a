// RODAS3 on problems with known solutions: order of convergence, damping of what is fast, moving boundary values, rest.
#include "faultline/numerics/rosenbrock.h"

#include <gtest/gtest.h>

#include <cmath>

#include "count_allocations.h"

namespace faultline {
namespace {

class Problem : public OdeSystem {
 public:
  int states() const override { return 2; }
  bool stiff() const override { return true; }
  const std::vector<std::pair<int, int>>& jacobian_entries() const override { return entries_; }

 protected:
  std::vector<std::pair<int, int>> entries_ = {{0, 0}, {0, 1}, {1, 0}, {1, 1}};
};

// x' = -2 x + y^2, y' = x - y - y^2: x = exp(-2 t), y = exp(-t) (Kaps, 1981, at unit stiffness).
class Kaps : public Problem {
 public:
  void derivative(double, const double* s, const double*, double* rate) override {
    rate[0] = -2 * s[0] + (s[1] * s[1] - s[0]) * k_;
    rate[1] = s[0] - s[1] * (1 + s[1]);
  }
  void jacobian(double t, const double* s, const double* c, double* rate, double* time_rate, double* entries) override {
    derivative(t, s, c, rate);
    time_rate[0] = time_rate[1] = 0;
    entries[0] = -2 - k_;
    entries[1] = 2 * s[1] * k_;
    entries[2] = 1;
    entries[3] = -1 - 2 * s[1];
  }
  double k_ = 1;  // stiffness; the solution does not depend on it
};

// x' = rate (cos t - x), a boundary that moves; y' = -y.
class Driven : public Problem {
 public:
  void derivative(double t, const double* s, const double*, double* rate) override {
    rate[0] = fast_ * (std::cos(t) - s[0]);
    rate[1] = -s[1];
  }
  void jacobian(double t, const double* s, const double* c, double* rate, double* time_rate, double* entries) override {
    derivative(t, s, c, rate);
    time_rate[0] = -fast_ * std::sin(t);
    time_rate[1] = 0;
    entries[0] = -fast_;
    entries[1] = entries[2] = 0;
    entries[3] = -1;
  }
  double fast_ = 1e6;
};

double kaps_error(double stiffness, int steps) {
  Kaps rig;
  rig.k_ = stiffness;
  const std::unique_ptr<Integrator> method = make_rosenbrock(rig);
  method->state()[0] = method->state()[1] = 1;
  for (int k = 0; k < steps; ++k) method->step(static_cast<double>(k) / steps, 1.0 / steps, nullptr);
  return std::hypot(method->state()[0] - std::exp(-2), method->state()[1] - std::exp(-1));
}

TEST(Rosenbrock, IsOfOrderThree) {
  const double coarse = kaps_error(1, 20), fine = kaps_error(1, 40);
  EXPECT_LT(coarse, 1e-5);
  EXPECT_GT(coarse / fine, 6.5);
  EXPECT_LT(coarse / fine, 9.5);
}

TEST(Rosenbrock, StaysAccurateWhereTheProblemIsStiff) {
  // Explicit methods would need steps of 1e-8 s.
  EXPECT_LT(kaps_error(1e8, 20), 1e-4);
  EXPECT_LT(kaps_error(1e8, 40), 0.4 * kaps_error(1e8, 20));
}

TEST(Rosenbrock, FollowsABoundaryThatMoves) {
  Driven rig;
  const std::unique_ptr<Integrator> method = make_rosenbrock(rig);
  method->state()[0] = method->state()[1] = 1;
  for (int k = 0; k < 100; ++k) {
    method->step(0.05 * k, 0.05, nullptr);
    ASSERT_NEAR(method->state()[0], std::cos(0.05 * (k + 1)), 1e-4) << k;
  }
}

TEST(Rosenbrock, WhatIsFastDiesWithoutSwinging) {
  // Off by 1e6, with 1e5 time constants in a step: what is left falls at least by that share from step to step.
  Driven rig;
  const std::unique_ptr<Integrator> method = make_rosenbrock(rig);
  method->state()[0] = 1e6;
  method->state()[1] = 1;
  method->step(0, 0.1, nullptr);
  EXPECT_NEAR(method->state()[0], std::cos(0.1), 100);
  method->step(0.1, 0.1, nullptr);
  EXPECT_NEAR(method->state()[0], std::cos(0.2), 2e-3);
}

TEST(Rosenbrock, SettlesWhereNothingMoves) {
  Kaps system;
  system.k_ = 1e6;
  double state[2] = {3, -0.2};
  EXPECT_EQ(settle(system, nullptr, state), std::vector<int>());
  double rate[2];
  system.derivative(0, state, nullptr, rate);
  EXPECT_NEAR(rate[0], 0, 1e-6);
  EXPECT_NEAR(rate[1], 0, 1e-9);
}

// x' = shape(x), which may have no root; y' = -y.
class Restless : public Problem {
 public:
  explicit Restless(double constant, double square) : constant_(constant), square_(square) {}
  void derivative(double, const double* s, const double*, double* rate) override {
    rate[0] = constant_ + square_ * s[0] * s[0];
    rate[1] = -s[1];
  }
  void jacobian(double t, const double* s, const double* c, double* rate, double* time_rate, double* entries) override {
    derivative(t, s, c, rate);
    time_rate[0] = time_rate[1] = 0;
    entries[0] = 2 * square_ * s[0];
    entries[1] = entries[2] = 0;
    entries[3] = -1;
  }
  double constant_, square_;
};

TEST(Rosenbrock, SettlingTellsWhatDoesNotComeToRest) {
  const auto moving = [](double constant, double square) {
    Restless system(constant, square);
    double state[2] = {0.5, 1};
    return settle(system, nullptr, state);
  };
  const std::vector<int> none, first = {0}, both = {0, 1};
  EXPECT_EQ(moving(1, -1), none);                       // x = 1
  EXPECT_EQ(moving(1, 0), first);                       // rises for ever
  EXPECT_EQ(moving(1, 1), first);                       // no root
  EXPECT_EQ(moving(std::nan(""), 1), both);             // not a number: nothing can be told
  EXPECT_EQ(moving(std::nan(""), std::nan("")), both);  // nor its Jacobian
  EXPECT_EQ(moving(-1, 1e-3), none);                    // an unstable root is one
}

void expect_no_allocation(Integrator& method, Integrator& beside) {
  method.state()[0] = method.state()[1] = beside.state()[0] = 1;
  const auto before = allocations();
  for (int k = 0; k < 100; ++k) {
    method.step(0.01 * k, 0.01, nullptr);
    method.lead(0.01 * k, 0.01, nullptr);
    beside.step_beside(0.01 * k, 0.01, nullptr, method, Look::once);
  }
  EXPECT_EQ(allocations(), before);
}

TEST(Rosenbrock, AStepAllocatesNothing) {
  Kaps rig, near;
  expect_no_allocation(*make_rosenbrock(rig), *make_rosenbrock(near));
}

// As a Kaps system that is pushed, beside one that is not, and off its start.
class Pushed : public Kaps {
 public:
  void derivative(double t, const double* s, const double* c, double* rate) override {
    Kaps::derivative(t, s, c, rate);
    rate[1] += push_ * s[0];
  }
  double push_ = 0;
};

class Explicit : public Pushed {
 public:
  bool stiff() const override { return false; }
};

// How far what goes beside is from a fine run of its own, over how far the two courses are apart.
template <class System = Pushed>
double beside_error(double stiffness, double push, double off, int steps) {
  System rig, near;
  rig.k_ = near.k_ = stiffness;
  near.push_ = push;
  const std::unique_ptr<Integrator> leader = make_integrator(rig), beside = make_integrator(near),
                                    alone = make_integrator(near);
  for (const auto* method : {&leader, &beside, &alone}) (*method)->state()[0] = (*method)->state()[1] = 1;
  beside->state()[1] = alone->state()[1] = 1 + off;
  constexpr int kFiner = 50;
  for (int k = 0; k < steps; ++k) {
    const double h = 1.0 / steps;
    leader->step(k * h, h, nullptr);
    leader->lead(k * h, h, nullptr);
    beside->step_beside(k * h, h, nullptr, *leader, Look::again);
    for (int i = 0; i < kFiner; ++i) alone->step(k * h, h / kFiner, nullptr);
  }
  return std::hypot(beside->state()[0] - alone->state()[0], beside->state()[1] - alone->state()[1]) /
         std::hypot(leader->state()[0] - alone->state()[0], leader->state()[1] - alone->state()[1]);
}

TEST(Rosenbrock, WhatIsNearGoesBesideToSecondOrder) {
  for (const double push : {0.0, 1e-3}) {
    const double off = push > 0 ? 0 : 1e-3;
    const double coarse = beside_error(1, push, off, 20), fine = beside_error(1, push, off, 40);
    EXPECT_LT(coarse, 0.05) << push;
    EXPECT_GT(coarse / fine, 3.2) << push;
    EXPECT_LT(beside_error(1e8, push, off, 20), 0.02) << push;
  }
}

TEST(RungeKutta, WhatIsNearGoesBesideToSecondOrder) {
  for (const double push : {0.0, 1e-3}) {
    const double off = push > 0 ? 0 : 1e-3;
    const double coarse = beside_error<Explicit>(1, push, off, 20), fine = beside_error<Explicit>(1, push, off, 40);
    EXPECT_LT(coarse, 0.05) << push;
    EXPECT_GT(coarse / fine, 3.2) << push;
  }
}

// A massless body that is pushed against its stop at 0.
class Stopped : public OdeSystem {
 public:
  int states() const override { return 1; }
  void derivative(double, const double* s, const double*, double* rate) override {
    rate[0] = s[0] <= 0 ? std::max(push_, 0.0) : push_;
  }
  void after_step(double, double* s, const double*) override { s[0] = std::max(s[0], 0.0); }
  double push_ = 1;
};

// Across a stop a difference is no derivative: it says that the body would be a million times as fast as it is.
TEST(RungeKutta, NothingGoesBesideABodyAtItsStop) {
  Stopped body;
  const std::unique_ptr<Integrator> leader = make_integrator(body);
  leader->state()[0] = 0.5;
  leader->step(0, 0.1, nullptr);
  EXPECT_TRUE(leader->lead(0, 0.1, nullptr));
  body.push_ = -1;
  leader->state()[0] = 0;
  leader->step(0.1, 0.1, nullptr);
  EXPECT_FALSE(leader->lead(0.1, 0.1, nullptr));
}

TEST(RungeKutta, AStepAllocatesNothing) {
  Explicit rig, near;
  expect_no_allocation(*make_integrator(rig), *make_integrator(near));
}

}  // namespace
}  // namespace faultline
