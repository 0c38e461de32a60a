// Time of the hydraulic drive's simulator per sample of 10 ms on one core, and how many times faster than the rig it is
// (aim: 300): as the datasheet's rig, as recordings show it, and with five effects, one of which adds states.
#include <benchmark/benchmark.h>

#include "allocations.h"
#include "rigs/hydraulic_drive/runs.h"

namespace faultline {
namespace {

void drive_simulator(benchmark::State& state, const std::vector<std::string>& effects) {
  SimulationSetup setup = drive_setup("paper");
  for (const std::string& effect : effects) setup.effects.push_back(parse_effect(effect));
  Simulator made(drive(), setup);
  benchmark::DoNotOptimize(made.step().values.data());
  const std::uint64_t before = allocations();
  std::uint64_t steps = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(made.step().values.data());
    ++steps;
  }
  state.counters["allocations"] = static_cast<double>(allocations() - before) / static_cast<double>(steps);
  state.counters["period"] = drive().sample_period;
}

BENCHMARK_CAPTURE(drive_simulator, no_effects, std::vector<std::string>{});
BENCHMARK_CAPTURE(drive_simulator, nuisance, drive().nuisance);
BENCHMARK_CAPTURE(drive_simulator, five_effects,
                  std::vector<std::string>{"hysteresis@command.valve:width=0.1",
                                           "entrained_air@compliance.motor_line:fraction=0.01",
                                           "droop@source.supply:resistance=1e9",
                                           "stribeck_friction@force.shaft:static_excess=0.3,velocity=10",
                                           "elasticity@transmission.shaft:compliance=0.1,damping=0.01"});

}  // namespace
}  // namespace faultline
