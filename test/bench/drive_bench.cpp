// Times of the hydraulic drive's parameter estimation on one core: the state variable filter of three signals, the
// whole stage (gating, filter, least squares, covariance; aim: 500 ns) with even and with uneven stamps, and a peer:
// the same filter and least squares with matrices from Eigen, written as the equations stand, without covariance of
// coloured noise, gating or names. And the two bilinear observers: five Runge-Kutta steps of three states with five
// sensitivities, one of one state with four.
#include <benchmark/benchmark.h>

#include <Eigen/Dense>
#include <cmath>

#include "allocations.h"
#include "faultline/estimators/estimator_stage.h"
#include "faultline/signal/state_variable_filter.h"
#include "rigs/hydraulic_drive/runs.h"

namespace faultline {
namespace {

constexpr std::size_t kSignals = 3;

const std::vector<Sample>& drive_samples() {
  static const std::vector<Sample> all = [] {
    const Recording r = simulate(drive(), drive_off_nominal("paper", 1), 20);
    std::vector<Sample> result;
    for (std::size_t k = 0; k < r.rows(); ++k) result.push_back(r.sample(k));
    return result;
  }();
  return all;
}

std::array<double, kSignals> signals_of(const Sample& sample) {
  return {sample.values[drive_column("shaft_speed")], sample.values[drive_column("motor_pressure")],
          sample.values[drive_column("pump_pressure")]};
}

// As in core_bench.cpp; time goes on from round to round.
template <class Step>
void measure(benchmark::State& state, Step&& step) {
  std::size_t k = 0;
  for (; k < 20; ++k) step(k);
  const std::uint64_t before = allocations();
  std::uint64_t steps = 0;
  for (auto _ : state) {
    step(k);
    if (++k == drive_samples().size()) k = 0;
    ++steps;
  }
  state.counters["allocations"] = static_cast<double>(allocations() - before) / static_cast<double>(steps);
}

void state_variable_filter(benchmark::State& state) {
  StateVariableFilter filter(2, 60, 3, kSignals);
  std::vector<std::array<double, kSignals>> signals;
  for (const Sample& sample : drive_samples()) signals.push_back(signals_of(sample));
  filter.reset(signals[0].data());
  measure(state, [&](std::size_t k) {
    filter.step(signals[k].data(), 0.01);
    benchmark::DoNotOptimize(filter.value(0, 1));
  });
}

void parameter_stage(benchmark::State& state, double jitter) {
  EstimatorStage stage(drive(), drive().estimators[drive().estimator("shaft")]);
  Estimate estimate;
  double time = 0;
  Sample sample = drive_samples()[0];
  measure(state, [&](std::size_t k) {
    time += 0.01 * (1 + (k % 2 ? jitter : -jitter));
    sample.values = drive_samples()[k].values;
    sample.time = time;
    stage.process(sample, estimate);
    benchmark::DoNotOptimize(estimate.quantities.data());
  });
}

void observer_stage(benchmark::State& state, const char* name) {
  EstimatorStage stage(drive(), drive().estimators[drive().estimator(name)]);
  Estimate estimate;
  double time = 0;
  Sample sample = drive_samples()[0];
  measure(state, [&](std::size_t k) {
    time += 0.01;
    sample.values = drive_samples()[k].values;
    sample.time = time;
    stage.process(sample, estimate);
    benchmark::DoNotOptimize(estimate.quantities.data());
  });
}

void peer_filter_and_least_squares(benchmark::State& state) {
  const double w = 60, period = 0.01, forgetting = 0.95;
  // (9): z = Phi z + sum of b_i p_i, here with weights of the samples; any numbers of that size do.
  Eigen::MatrixXd phi(2, 2), weight(2, 4);
  const double e = std::exp(-w * period);
  phi << e * (1 + w * period), e * period, -e * w * w * period, e * (1 - w * period);
  weight << 0.05, 0.08, -0.01, 0.002, 9, -6, -4, 1;
  std::vector<Eigen::VectorXd> z(kSignals, Eigen::VectorXd::Zero(2)), x(kSignals, Eigen::VectorXd::Zero(4));
  Eigen::VectorXd theta = Eigen::VectorXd::Zero(3), h(3);
  Eigen::MatrixXd p = Eigen::MatrixXd::Identity(3, 3);
  measure(state, [&](std::size_t k) {
    const std::array<double, kSignals> signals = signals_of(drive_samples()[k]);
    for (std::size_t s = 0; s < kSignals; ++s) {
      for (int i = 3; i > 0; --i) x[s][i] = x[s][i - 1];
      x[s][0] = s == 0 ? signals[s] : 1e-5 * signals[s];
      z[s] = phi * z[s] + weight * x[s];
      h[static_cast<int>(s)] = z[s][0];
    }
    const Eigen::VectorXd ph = p * h;
    const Eigen::VectorXd gain = ph / (forgetting + h.dot(ph));
    theta += gain * (z[0][1] - h.dot(theta));
    p = (p - gain * ph.transpose()) / forgetting;
    if (k == 0) p.setIdentity();
    benchmark::DoNotOptimize(theta.data());
  });
}

BENCHMARK_CAPTURE(observer_stage, line, "line_observer");
BENCHMARK_CAPTURE(observer_stage, shaft, "shaft_observer");
BENCHMARK(state_variable_filter);
BENCHMARK_CAPTURE(parameter_stage, even, 0.0);
BENCHMARK_CAPTURE(parameter_stage, uneven, 0.01);
BENCHMARK(peer_filter_and_least_squares);

}  // namespace
}  // namespace faultline
