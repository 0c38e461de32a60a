// Times of the core on one core: filter step, its peer, the stages of a diagnosis, the simulator. `allocations` counts
// what a step takes from the heap (aim: none); `real_time` is how many times faster than the rig (aim: 300 simulating,
// 500 diagnosing). The peer is a plain Kalman step of the same size with full matrices from Eigen: what a filter costs
// at least that is linear.
#include <benchmark/benchmark.h>

#include <Eigen/Dense>

#include "count_allocations.h"
#include "faultline/alarms/alarm_stage.h"
#include "faultline/alarms/diagnosis.h"
#include "faultline/estimators/estimator_stage.h"
#include "faultline/estimators/state_estimator.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

const std::vector<Sample>& samples() {
  static const std::vector<Sample> all = [] {
    SimulationSetup setup = off_nominal("random", 1);
    open_bypass(setup, 5, 5);
    const Recording r = simulate(servo(), setup, 20);
    std::vector<Sample> result;
    for (std::size_t k = 0; k < r.rows(); ++k) result.push_back(r.sample(k));
    return result;
  }();
  return all;
}

// Calls step(k) for ever; k runs over the recording. `allocations`: per step, after the first.
template <class Step>
void measure(benchmark::State& state, Step&& step) {
  std::size_t k = 0;
  step(k++);
  const std::uint64_t before = allocations();
  std::uint64_t steps = 0;
  for (auto _ : state) {
    step(k);
    if (++k == samples().size()) k = 0;
    ++steps;
  }
  state.counters["allocations"] = static_cast<double>(allocations() - before) / static_cast<double>(steps);
  state.counters["real_time"] =
      benchmark::Counter(static_cast<double>(steps) * servo().sample_period, benchmark::Counter::kIsRate);
}

void filter_step(benchmark::State& state, const char* type) {
  const auto model = make_process_model("servo_leak", servo(), servo().estimators.front().settings);
  const auto filter = make_state_estimator(type, *model);
  double x[kMaximumStates], variance[kMaximumStates], y[kMaximumOutputs];
  const bool use[kMaximumOutputs] = {true, true, true, true};
  measure(state, [&](std::size_t k) {
    const double* channels = samples()[k].values.data();
    if (k == 0) {
      model->initial(channels, x, variance);
      filter->reset(x, variance);
    } else {
      model->measurement(channels, y);
      filter->predict(1e-3, 1);
      filter->correct(y, use);
    }
    model->take_inputs(channels);
    benchmark::DoNotOptimize(filter->state());
  });
}

void filter_step_second_order(benchmark::State& state) { filter_step(state, "divided_difference_2"); }
void filter_step_first_order(benchmark::State& state) { filter_step(state, "divided_difference_1"); }

void filter_step_unscented(benchmark::State& state) { filter_step(state, "unscented_kalman"); }
void filter_step_extended(benchmark::State& state) { filter_step(state, "extended_kalman"); }

void peer_kalman_step(benchmark::State& state) {
  Eigen::VectorXd x = Eigen::VectorXd::Zero(6), y(4);
  Eigen::MatrixXd a = Eigen::MatrixXd::Identity(6, 6) * 0.95, p = Eigen::MatrixXd::Identity(6, 6),
                  c = Eigen::MatrixXd::Zero(4, 6);
  const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(6, 6), q = 0.01 * one, r = Eigen::MatrixXd::Identity(4, 4);
  for (int i = 0; i < 4; ++i) c(i, i) = 1;
  for (int i = 0; i < 5; ++i) a(i, i + 1) = 0.01;
  measure(state, [&](std::size_t k) {
    for (int i = 0; i < 4; ++i) y[i] = samples()[k].values[static_cast<std::size_t>(3 + i)] * 1e-6;
    x = a * x;
    p = a * p * a.transpose() + q;
    const Eigen::MatrixXd s = c * p * c.transpose() + r;
    const Eigen::MatrixXd gain = p * c.transpose() * s.inverse();
    x += gain * (y - c * x);
    p = (one - gain * c) * p;
    benchmark::DoNotOptimize(x.data());
  });
}

void estimator_stage(benchmark::State& state) {
  EstimatorStage stage(servo(), servo().estimators.front());
  Estimate estimate;
  measure(state, [&](std::size_t k) { stage.process(samples()[k], estimate); });
}

// What the estimators of a rig say about every sample, in the order of the datasheet.
std::vector<std::vector<Estimate>> estimates_of(const Datasheet& sheet) {
  std::vector<EstimatorStage> stages;
  for (const StageSpec& spec : sheet.estimators) stages.emplace_back(sheet, spec);
  std::vector<std::vector<Estimate>> result(samples().size(), std::vector<Estimate>(stages.size()));
  std::vector<Estimate> last(stages.size());
  for (std::size_t k = 0; k < samples().size(); ++k) {
    for (std::size_t i = 0; i < stages.size(); ++i) stages[i].process(samples()[k], last[i]);
    result[k] = last;
  }
  return result;
}

void alarm_stage(benchmark::State& state, const Datasheet& sheet) {
  const std::vector<std::vector<Estimate>> estimates = estimates_of(sheet);
  AlarmStage stage(sheet);
  measure(state, [&](std::size_t k) { stage.process(estimates[k]); });
}

void offline_diagnosis(benchmark::State& state, const Datasheet& sheet) {
  Diagnosis diagnosis(sheet);
  measure(state, [&](std::size_t k) { diagnosis.process(samples()[k]); });
}

void detector(benchmark::State& state, const std::string& name) {
  const std::vector<std::vector<Estimate>> estimates = estimates_of(servo_filter());
  for (const StageSpec& spec : servo().detectors) {
    if (spec.name != name) continue;
    const auto made = make_detector(servo(), spec);
    Detection detection;
    return measure(state, [&](std::size_t k) { made->process(estimates[k].front(), detection); });
  }
  state.SkipWithError(("the servo actuator has no detector '" + name + "'").c_str());
}

void simulator(benchmark::State& state, bool with_effects) {
  SimulationSetup setup = servo_setup("random");
  if (with_effects)
    for (const char* effect :
         {"hysteresis@command.valve_command:width=0.1", "entrained_air@compliance.chambers:fraction=0.01",
          "droop@source.supply_pressure:resistance=1e9",
          "stribeck_friction@force.piston:static_excess=50,velocity=0.02",
          "orifice_leakage@flow.chamber_a_chamber_b:coefficient=1e-8,from=1,to=5"})
      setup.effects.push_back(parse_effect(effect));
  Simulator made(servo(), setup);
  measure(state, [&](std::size_t) { benchmark::DoNotOptimize(made.step().values.data()); });
}

BENCHMARK(filter_step_second_order);
BENCHMARK(filter_step_first_order);
BENCHMARK(filter_step_unscented);
BENCHMARK(filter_step_extended);
BENCHMARK(peer_kalman_step);
BENCHMARK(estimator_stage);
BENCHMARK_CAPTURE(alarm_stage, filter, servo_filter());
BENCHMARK_CAPTURE(alarm_stage, whole, servo());
BENCHMARK_CAPTURE(offline_diagnosis, filter, servo_filter());
BENCHMARK_CAPTURE(offline_diagnosis, whole, servo());
BENCHMARK_CAPTURE(detector, leak, std::string("internal_leak"));
BENCHMARK_CAPTURE(detector, band, std::string("pressure_redundancy"));
BENCHMARK_CAPTURE(detector, consistency, std::string("model_fit"));
BENCHMARK_CAPTURE(simulator, no_effects, false);
BENCHMARK_CAPTURE(simulator, five_effects, true);

}  // namespace
}  // namespace faultline
