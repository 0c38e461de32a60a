// Times of the pump-controlled cylinder's filters on one core, a step each of prediction and correction by two rows:
// the linear filter (aim: 300 ns) and the extended one (aim: 1 us); and the guarded stage, which runs four of those.
#include <benchmark/benchmark.h>

#include "allocations.h"
#include "faultline/estimators/estimator_stage.h"
#include "faultline/estimators/state_estimator.h"
#include "rigs/pump_cylinder/runs.h"

namespace faultline {
namespace {

const std::vector<Sample>& cylinder_samples() {
  static const std::vector<Sample> all = [] {
    const Recording r = simulate(cylinder(), cylinder_off_nominal("multisine", 1), 10);
    std::vector<Sample> result;
    for (std::size_t k = 0; k < r.rows(); ++k) result.push_back(r.sample(k));
    return result;
  }();
  return all;
}

Settings cylinder_filter(const std::string& model) {
  std::map<std::string, double> numbers = {{"bulk_modulus", 1.3e9}};
  std::map<std::string, std::string> words = {{"pressures", "b"}};
  if (model == "pump_cylinder_nonlinear") {
    numbers = {{"friction_width", 0.01}};
    words["friction"] = "signed";
  }
  return Settings("bench", numbers,
                  {{"process_noise", {2e-9, 2e-12, 5e8, 5e8}},
                   {"measurement_noise", {2.36e-8, 5.77e9, 6.55e9}},
                   {"initial_variance", {2.36e-8, 1e-4, 1e12, 1e12}}},
                  words);
}

void cylinder_step(benchmark::State& state, const char* name) {
  const auto model = make_process_model(name, cylinder(), cylinder_filter(name));
  const auto filter = make_state_estimator("extended_kalman", *model);
  const std::vector<Sample>& samples = cylinder_samples();
  double first[4], variance[4], y[2];
  const bool use[2] = {true, true};
  model->initial(samples[0].values.data(), first, variance);
  filter->reset(first, variance);
  std::size_t k = 0;
  const std::uint64_t before = allocations();
  for (auto _ : state) {
    model->take_inputs(samples[k].values.data());
    if (++k == samples.size()) k = 0;
    filter->predict(1e-3, 1);
    model->measurement(samples[k].values.data(), y);
    filter->correct(y, use);
    benchmark::DoNotOptimize(filter->state()[2]);
  }
  state.counters["allocations"] =
      benchmark::Counter(static_cast<double>(allocations() - before), benchmark::Counter::kAvgIterations);
}

void cylinder_guarded_stage(benchmark::State& state) {
  EstimatorStage stage(cylinder(), cylinder().estimators.front());
  Estimate estimate;
  Sample sample = cylinder_samples()[0];
  std::size_t k = 0;
  double time = 0;
  const std::uint64_t before = allocations();
  for (auto _ : state) {
    sample.values = cylinder_samples()[k].values;
    sample.time = time += 1e-3;
    if (++k == cylinder_samples().size()) k = 0;
    stage.process(sample, estimate);
  }
  state.counters["allocations"] =
      benchmark::Counter(static_cast<double>(allocations() - before), benchmark::Counter::kAvgIterations);
}

BENCHMARK_CAPTURE(cylinder_step, linear, "pump_cylinder_linear");
BENCHMARK_CAPTURE(cylinder_step, extended, "pump_cylinder_nonlinear");
BENCHMARK(cylinder_guarded_stage);

}  // namespace
}  // namespace faultline
