// What multi-variable histograms cost beside a plain limit check: time and bytes per monitored variable, and a fleet of
// valves on one core. A valve: nine variables explained as in Manninen's Table 11 (three by two variables, six by one),
// 8 bins an axis, 32 sections. `bytes`: per variable. `real_time`: how many times faster than 10 samples a second.
#include <benchmark/benchmark.h>

#include "allocations.h"
#include "faultline/estimators/histogram.h"
#include "faultline/numerics/random.h"

namespace faultline {
namespace {

constexpr int kVariables = 9, kByTwo = 3;
constexpr double kRate = 10;  // Hz
constexpr std::size_t kSamples = 4096;

struct Inputs {
  double point[2], value[kVariables];
};

// Operating points that are held for some time, values with noise around them.
const std::vector<Inputs>& inputs() {
  static const std::vector<Inputs> all = [] {
    std::vector<Inputs> made(kSamples);
    Random random(1);
    for (std::size_t k = 0; k < kSamples; ++k) {
      for (double& p : made[k].point) p = std::floor(random.uniform(0, kExplanatoryQuanta));
      if (k % 64 > 0) std::copy_n(made[k - 1].point, 2, made[k].point);
      for (double& v : made[k].value) v = std::floor(20000 + 0.3 * made[k].point[0] + 300 * random.normal());
    }
    return made;
  }();
  return all;
}

template <class A>
class Valve {
 public:
  Valve() {
    HistogramShape shape;
    shape.minimum = 16;
    shape.memory = 30000;
    for (int i = 0; i < kVariables; ++i) {  // as config/control_valve/stages.yaml has them
      shape.bins[0] = i < kByTwo ? 8 : 32;
      shape.bins[1] = i < kByTwo ? 8 : 1;
      histograms_.emplace_back(shape);
    }
  }
  void take(const Inputs& in) {
    using Value = typename A::Value;
    const Value point[2] = {static_cast<Value>(in.point[0]), static_cast<Value>(in.point[1])};
    for (std::size_t i = 0; i < kVariables; ++i) {
      const std::size_t bin = histograms_[i].bin_of(point);
      const auto value = static_cast<Value>(in.value[i]);
      histograms_[i].judge(bin, value);
      histograms_[i].learn(bin, value);
    }
  }
  double bytes() const {
    std::size_t sum = 0;
    for (const Histogram<A>& h : histograms_) sum += h.bytes();
    return static_cast<double>(sum) / kVariables;
  }

 private:
  std::vector<Histogram<A>> histograms_;
};

// The plain limit check: a moving average against two fixed limits.
class Limits {
 public:
  void take(const Inputs& in) {
    for (std::size_t i = 0; i < kVariables; ++i) {
      average_[i] += (in.value[i] - average_[i]) / 32;
      beyond_ += average_[i] < low_[i] || average_[i] > high_[i];
    }
    benchmark::DoNotOptimize(beyond_);
  }
  double bytes() const { return static_cast<double>(sizeof *this) / kVariables; }

 private:
  double average_[kVariables] = {}, low_[kVariables] = {}, high_[kVariables] = {};
  int beyond_ = 0;
};

template <class Monitor>
void one_valve(benchmark::State& state) {
  Monitor monitor;
  for (int round = 0; round < 20; ++round)
    for (const Inputs& in : inputs()) monitor.take(in);
  const std::uint64_t before = allocations();
  std::size_t k = 0;
  for (auto _ : state) {
    monitor.take(inputs()[k]);
    k = (k + 1) % kSamples;
  }
  state.counters["allocations"] = static_cast<double>(allocations() - before);
  state.counters["bytes"] = monitor.bytes();
  state.counters["per_variable"] = benchmark::Counter(static_cast<double>(state.iterations()) * kVariables,
                                                      benchmark::Counter::kIsRate | benchmark::Counter::kInvert);  // s
}

// One pass: a sample of every valve, each with memory and an operating point of its own.
template <class A>
void fleet(benchmark::State& state) {
  std::vector<Valve<A>> valves(static_cast<std::size_t>(state.range(0)));
  std::size_t k = 0;
  const auto pass = [&] {
    for (std::size_t v = 0; v < valves.size(); ++v) valves[v].take(inputs()[(k + 97 * v) % kSamples]);
    ++k;
  };
  for (int round = 0; round < 40; ++round) pass();
  const std::uint64_t before = allocations();
  for (auto _ : state) pass();
  state.counters["allocations"] = static_cast<double>(allocations() - before);
  state.counters["bytes"] = valves[0].bytes();
  state.counters["real_time"] =
      benchmark::Counter(static_cast<double>(state.iterations()) / kRate, benchmark::Counter::kIsRate);
}

BENCHMARK(one_valve<Limits>)->Name("valve/limits");
BENCHMARK(one_valve<Valve<FloatingArithmetic>>)->Name("valve/histograms_floating");
BENCHMARK(one_valve<Valve<IntegerArithmetic>>)->Name("valve/histograms_integer");
BENCHMARK(fleet<FloatingArithmetic>)->Name("fleet/histograms_floating")->Arg(10000);
BENCHMARK(fleet<IntegerArithmetic>)->Name("fleet/histograms_integer")->Arg(10000);

}  // namespace
}  // namespace faultline
