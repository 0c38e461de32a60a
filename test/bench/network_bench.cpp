// What a step of a network costs: two units of 20 neurons that integrate (207 weights), and a black box of 10 neurons
// with 18 taps (212 weights), as on the rig pump_cylinder.
#include <benchmark/benchmark.h>

#include "allocations.h"
#include "faultline/networks/training.h"

namespace faultline {
namespace {

NetworkShape four_in_two_out() {
  NetworkShape shape;
  for (const char* name : {"u", "v", "w", "x"}) shape.inputs.push_back({name, 0, NetworkInput::Kind::plain});
  shape.outputs = {{"a", 0}, {"b", 0}};
  return shape;
}

NetworkShape structured() {
  NetworkShape shape = four_in_two_out();
  for (const std::size_t output : {0, 1}) {
    NetworkUnit unit;
    unit.outputs = {output};
    for (std::size_t input = output; input < 2; ++input) unit.sum.push_back({false, input, 0});
    for (std::size_t other = 0; other < 2; ++other) unit.sum.push_back({true, other, 1});
    unit.beside = {{false, 2, 0}, {false, 3, 0}};
    unit.hidden = 20;
    unit.integrating = true;
    unit.gain = 0.3;
    shape.units.push_back(unit);
  }
  return shape;
}

NetworkShape black_box() {
  NetworkShape shape = four_in_two_out();
  NetworkUnit unit;
  unit.outputs = {0, 1};
  for (std::size_t lag = 0; lag < 3; ++lag) {
    for (std::size_t input = 0; input < 4; ++input) unit.beside.push_back({false, input, lag});
    for (std::size_t output = 0; output < 2; ++output) unit.beside.push_back({true, output, lag + 1});
  }
  unit.hidden = 10;
  shape.units.push_back(unit);
  return shape;
}

void network_step(benchmark::State& state, const NetworkShape& shape) {
  Network network(shape);
  const Eigen::VectorXd weights = initial_weights(shape, 1);
  const double start[] = {0.1, 0.2, 0.3, 0.4};
  network.start(start, start);
  double inputs[] = {0.1, 0.2, 0.3, 0.4};
  const double low[] = {-2, -2}, high[] = {2, 2};  // random weights would integrate away, where tanh is cheap
  const std::uint64_t before = allocations();
  for (auto _ : state) {
    inputs[0] = -inputs[0];
    network.step(weights.data(), inputs);
    network.bound(low, high);
    network.take(start);
    benchmark::DoNotOptimize(network.outputs()[0]);
  }
  state.counters["allocations"] =
      benchmark::Counter(static_cast<double>(allocations() - before), benchmark::Counter::kAvgIterations);
  state.counters["weights"] = static_cast<double>(shape.weights());
}

BENCHMARK_CAPTURE(network_step, structured, structured());
BENCHMARK_CAPTURE(network_step, black_box, black_box());

}  // namespace
}  // namespace faultline
