// Times of the cooling circuit's diagnosis on one core: least squares, CUSUM and redline steps, the filters of all
// five branches, and the whole circuit (every estimator, detector and the isolation) per sample; a sample stands for 1
// ms.
#include <benchmark/benchmark.h>

#include <map>

#include "allocations.h"
#include "faultline/alarms/diagnosis.h"
#include "faultline/estimators/recursive_least_squares.h"
#include "faultline/numerics/random.h"
#include "rigs/cooling_circuit/recordings.h"

namespace faultline {
namespace {

const std::vector<Sample>& cooling_samples(bool leaking) {
  const auto make = [](const char* effect) {
    const Recording r = simulate(cooling(), cooling_recording("steady", 1, effect), 12);
    std::vector<Sample> result;
    for (std::size_t k = 0; k < r.rows(); ++k) result.push_back(r.sample(k));
    return result;
  };
  static const std::vector<Sample> healthy = make("");
  static const std::vector<Sample> leak = make("orifice_leakage@flow.t_outlet_ambient:coefficient=2e-8,from=5");
  return leaking ? leak : healthy;
}

template <class Step>
void measure(benchmark::State& state, std::size_t count, Step&& step) {
  std::size_t k = 0;
  step(k++);
  const std::uint64_t before = allocations();
  std::uint64_t steps = 0;
  for (auto _ : state) {
    step(k);
    if (++k == count) k = 0;
    ++steps;
  }
  state.counters["allocations"] = static_cast<double>(allocations() - before) / static_cast<double>(steps);
}

void least_squares_step(benchmark::State& state, int parameters) {
  RecursiveLeastSquares fit(parameters, {0.99, 1, 100, 0});
  Random random(1);
  std::vector<double> rows(4000);
  for (double& value : rows) value = 1 + 0.1 * random.normal();
  measure(state, 3990, [&](std::size_t k) {
    fit.step(&rows[k], rows[k + 7]);
    benchmark::DoNotOptimize(fit.parameters()[0]);
  });
}

void one_detector(benchmark::State& state, const std::string& type) {
  std::map<std::string, double> numbers = {{"minimum_time", 0.2}, {"release_time", 0.2}, {"armed_above", 1}};
  if (type == "cusum")
    numbers.insert({{"relative_change", 0.005}, {"threshold_changes", 3}, {"learn", 1}});
  else
    numbers.insert({{"relative_margin", 0.05}, {"learn", 0.2}});
  const auto made = make_detector(
      cooling(), {type, type, Settings("bench", numbers, {}, {{"quantity", "t_c"}, {"armed_by", "steady_time"}})});
  EstimatorStage stage(cooling(), cooling().estimators.front());
  std::vector<Estimate> estimates(64);  // as few as stay in the cache: in a diagnosis an estimate has just been written
  for (std::size_t k = 0; k < 6000; ++k) {
    Estimate estimate;
    stage.process(cooling_samples(false)[k], estimate);
    if (k >= 6000 - estimates.size()) estimates[k + estimates.size() - 6000] = estimate;
  }
  Detection detection;
  measure(state, estimates.size(), [&](std::size_t k) { made->process(estimates[k], detection); });
}

void branch_filters(benchmark::State& state, const std::string& type) {
  StageSpec spec = cooling().estimators[cooling().estimator("branch_filter")];
  spec.type = type;
  EstimatorStage stage(cooling(), spec);
  Estimate estimate;
  measure(state, cooling_samples(false).size(),
          [&](std::size_t k) { stage.process(cooling_samples(false)[k], estimate); });
}

void balances(benchmark::State& state) {
  EstimatorStage stage(cooling(), cooling().estimators.front());
  Estimate estimate;
  measure(state, cooling_samples(false).size(),
          [&](std::size_t k) { stage.process(cooling_samples(false)[k], estimate); });
}

void whole_circuit(benchmark::State& state, bool leaking) {
  Diagnosis diagnosis(cooling());
  measure(state, cooling_samples(leaking).size(),
          [&](std::size_t k) { diagnosis.process(cooling_samples(leaking)[k]); });
}

BENCHMARK_CAPTURE(least_squares_step, scalar, 1);
BENCHMARK_CAPTURE(least_squares_step, three, 3);
BENCHMARK_CAPTURE(one_detector, cusum, std::string("cusum"));
BENCHMARK_CAPTURE(one_detector, redline, std::string("redline"));
BENCHMARK(balances);
BENCHMARK_CAPTURE(branch_filters, extended, std::string("extended_kalman"));
BENCHMARK_CAPTURE(branch_filters, unscented, std::string("unscented_kalman"));
BENCHMARK_CAPTURE(whole_circuit, healthy, false);
BENCHMARK_CAPTURE(whole_circuit, leaking, true);

}  // namespace
}  // namespace faultline
