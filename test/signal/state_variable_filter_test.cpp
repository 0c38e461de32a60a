// The state variable filter against the differential equation it solves and its frequency response; uneven samples.
#include "faultline/signal/state_variable_filter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <string>
#include <vector>

#include "faultline/numerics/random.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kPi = 3.14159265358979323846;

// x = sum a_i t^i and its filtered derivatives, by a chain of lags y_i' = w (y_i-1 - y_i) in steps so fine that only
// rounding is left: another realisation than the filter's.
struct Chain {
  int order;
  double bandwidth;
  std::vector<double> polynomial;
  std::array<double, 5> y{};

  double signal(double t) const {
    double sum = 0;
    for (std::size_t i = polynomial.size(); i-- > 0;) sum = sum * t + polynomial[i];
    return sum;
  }
  std::array<double, 5> rate(double t, const std::array<double, 5>& at) const {
    std::array<double, 5> result{};
    for (int i = 0; i < order; ++i)
      result[static_cast<std::size_t>(i)] =
          bandwidth * ((i == 0 ? signal(t) : at[static_cast<std::size_t>(i - 1)]) - at[static_cast<std::size_t>(i)]);
    return result;
  }
  void run(double from, double to) {
    const int steps = 100;
    const double h = (to - from) / steps;
    for (int k = 0; k < steps; ++k) {
      const double t = from + k * h;
      const auto moved = [&](const std::array<double, 5>& slope, double by) {
        std::array<double, 5> result = y;
        for (std::size_t i = 0; i < 5; ++i) result[i] += by * slope[i];
        return result;
      };
      const auto k1 = rate(t, y), k2 = rate(t + h / 2, moved(k1, h / 2)), k3 = rate(t + h / 2, moved(k2, h / 2)),
                 k4 = rate(t + h, moved(k3, h));
      for (std::size_t i = 0; i < 5; ++i) y[i] += h / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]);
    }
  }
  // w^d sum (-1)^j binomial(d, j) y_{n-d+j}
  double derivative(int d) const {
    double sum = 0, binomial = 1;
    for (int j = 0; j <= d; ++j) {
      sum += (j % 2 ? -1 : 1) * binomial * y[static_cast<std::size_t>(order - 1 - d + j)];
      binomial *= static_cast<double>(d - j) / (j + 1);
    }
    return sum * std::pow(bandwidth, d);
  }
  // The lags behind derivatives of the last: y_{n-d} = sum binomial(d, j) y_n^(j)/w^j.
  void take(const StateVariableFilter& filter) {
    for (int d = 0; d < order; ++d) {
      double sum = 0, binomial = 1;
      for (int j = 0; j <= d; ++j) {
        sum += binomial * filter.value(0, j) / std::pow(bandwidth, j);
        binomial *= static_cast<double>(d - j) / (j + 1);
      }
      y[static_cast<std::size_t>(order - 1 - d)] = sum;
    }
  }
};

struct Case {
  int order, interpolation;
};

class Filter : public ::testing::TestWithParam<Case> {};

TEST_P(Filter, IsExactForPolynomialsOfItsOrderWhateverTheStep) {
  const auto [order, r] = GetParam();
  const double bandwidth = 40;
  const int first = std::max(r, 1);  // step with samples enough for the full order
  for (const bool even : {true, false}) {
    Chain chain{order, bandwidth, {2}, {}};
    for (int i = 1; i <= r; ++i) chain.polynomial.push_back(std::pow(-3.0, i));
    StateVariableFilter filter(order, bandwidth, r, 1);
    double t = 0, x = chain.signal(0);
    filter.reset(&x);
    Random random(4);
    for (int k = 1; k <= 40; ++k) {
      const double dt = even ? 0.01 : random.uniform(0.002, 0.018);
      if (k == first) chain.take(filter);
      if (k >= first) chain.run(t, t + dt);
      t += dt;
      x = chain.signal(t);
      filter.step(&x, dt);
      if (k < first) continue;
      for (int d = 0; d < order; ++d)
        ASSERT_NEAR(filter.value(0, d), chain.derivative(d), 1e-9 * std::pow(bandwidth, d) * (1 + std::abs(x)))
            << "derivative " << d << " step " << k << (even ? " even" : " uneven");
    }
  }
}

TEST_P(Filter, FrequencyResponseIsTheTheorysWhereSamplesAreDense) {
  const auto [order, r] = GetParam();
  const double bandwidth = 30, period = 1e-3;
  for (const double omega : {3.0, 30.0, 120.0}) {
    StateVariableFilter filter(order, bandwidth, r, 1);
    double x = 0;
    filter.reset(&x);
    // Over one turn of the sine, at the end.
    const int turn = static_cast<int>(std::lround(2 * kPi / omega / period)), settle = 1500;
    const double exact = 2 * kPi / (turn * period);
    std::array<std::complex<double>, 4> response{};
    for (int k = 1; k <= settle + turn; ++k) {
      const double t = k * period;
      x = std::sin(exact * t);
      filter.step(&x, period);
      if (k > settle)
        for (int d = 0; d < order; ++d)
          response[static_cast<std::size_t>(d)] += 2.0 / turn * filter.value(0, d) *
                                                   std::exp(std::complex<double>(0, -exact * t)) *
                                                   std::complex<double>(0, 1);
    }
    for (int d = 0; d < order; ++d) {
      const std::complex<double> theory = std::pow(bandwidth / std::complex<double>(bandwidth, exact), order) *
                                          std::pow(std::complex<double>(0, exact), d);
      // What interpolation leaves: half a period late and a staircase (0), the chord's (1), next to nothing (2, 3).
      const double left = r == 0   ? exact * period + 0.01
                          : r == 1 ? std::pow(exact * period, 2) / 6
                                   : std::pow(exact * period, 3);
      EXPECT_LT(std::abs(response[static_cast<std::size_t>(d)] - theory), (left + 1e-6) * std::abs(theory))
          << "omega " << omega << " derivative " << d;
    }
  }
}

TEST_P(Filter, HoldsARestAndKeepsDerivativesConsistent) {
  const auto [order, r] = GetParam();
  StateVariableFilter filter(order, 25, r, 2);
  double x[2] = {5, -3e6};
  filter.reset(x);
  for (int k = 0; k < 200; ++k) filter.step(x, 0.01);
  EXPECT_NEAR(filter.value(0, 0), 5, 1e-11);
  EXPECT_NEAR(filter.value(1, 0), -3e6, 1e-5);
  for (int d = 1; d < order; ++d) EXPECT_NEAR(filter.value(1, d), 0, 1e-7 * 3e6 * std::pow(25, d) * 1e-5) << d;
}

std::vector<Case> all_cases() {
  std::vector<Case> result;
  for (int order = 1; order <= 4; ++order)
    for (int r = 0; r <= 3; ++r) result.push_back({order, r});
  return result;
}

INSTANTIATE_TEST_SUITE_P(Orders, Filter, ::testing::ValuesIn(all_cases()), [](const auto& which) {
  return "order_" + std::to_string(which.param.order) + "_interpolation_" + std::to_string(which.param.interpolation);
});

TEST(StateVariableFilter, IsExactHoweverSlowOrFastItIsAgainstTheSamples) {
  // A ramp filtered lags by n/w, to all digits; the printed recursion from A^-1 has none left at w T = 1e-5.
  for (const double bandwidth : {1e-3, 1.0, 1e3, 1e5}) {
    StateVariableFilter filter(2, bandwidth, 3, 1);
    double x = 0;
    filter.reset(&x);
    for (int k = 1; k <= 1000; ++k) filter.step(&(x = 0.01 * k), 0.01);
    // x_F = t - 2/w + (t + 2/w) e^(-w t), or its series.
    const double t = 10, w = bandwidth;
    const double exact =
        w * t > 1e-1 ? t - 2 / w + (t + 2 / w) * std::exp(-w * t)
                     : t * w * t * w * t * (1.0 / 6 - w * t / 12 + std::pow(w * t, 2) / 40 - std::pow(w * t, 3) / 180);
    EXPECT_NEAR(filter.value(0, 0), exact, 1e-9 * exact) << w;
  }
}

TEST(StateVariableFilter, ResetForgetsWhatWasBefore) {
  StateVariableFilter one(3, 50, 3, 1), other(3, 50, 3, 1);
  double x = 4;
  one.reset(&x);
  for (int k = 0; k < 20; ++k) one.step(&(x = k * k), k % 2 ? 0.01 : 0.013);
  x = 7;
  one.reset(&x);
  other.reset(&x);
  for (int k = 0; k < 20; ++k) {
    x = std::sin(0.3 * k);
    one.step(&x, 0.02);
    other.step(&x, 0.02);
    for (int d = 0; d < 3; ++d) ASSERT_EQ(one.value(0, d), other.value(0, d));
  }
}

TEST(StateVariableFilter, RefusesWhatItCannotBe) {
  EXPECT_THROW(StateVariableFilter(0, 10, 1, 1), InputError);
  EXPECT_THROW(StateVariableFilter(5, 10, 1, 1), InputError);
  EXPECT_THROW(StateVariableFilter(2, 10, 4, 1), InputError);
  EXPECT_THROW(StateVariableFilter(2, 10, -1, 1), InputError);
  EXPECT_THROW(StateVariableFilter(2, 0, 1, 1), InputError);
  EXPECT_THROW(StateVariableFilter(2, std::nan(""), 1, 1), InputError);
}

}  // namespace
}  // namespace faultline
