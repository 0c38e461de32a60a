// Steps from several states at once are those from each, whether the rig's method is explicit or implicit.
#include "faultline/rig/step_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "config_folder.h"
#include "count_allocations.h"
#include "faultline/rig/simulator.h"

namespace faultline {
namespace {

class StepsOfRig : public testing::TestWithParam<std::string> {};

TEST_P(StepsOfRig, StepsOfManyAreTheirOwn) {
  constexpr double kNear = 0.1;  // of how far the ends are apart (numerics/integrator.h)
  constexpr std::size_t kEvery = 20;
  const Datasheet sheet = find_datasheet(config_folder(), GetParam());
  const std::size_t n = sheet.states.size(), count = 2 * n + 1;
  SimulationSetup setup;
  setup.noise = false;
  const Recording recording = simulate(sheet, setup, std::max(2.0, 200 * sheet.sample_period));
  StepModel model(sheet, {}, static_cast<int>(2 * n));
  std::vector<double> from(sheet.channels.size()), to(from), state(n), next(n), sizes(n, 0.0);
  model.prepare(0, recording.row(0), from.data());
  model.start(from.data(), state.data());
  double off = 0, apart = 0;
  for (std::size_t row = 1; row < recording.rows(); ++row) {
    model.prepare(recording.time[row], recording.row(row), to.data());
    for (std::size_t i = 0; i < n; ++i) sizes[i] = std::max(sizes[i], std::abs(state[i]));
    if (row > recording.rows() / 4 && row % kEvery == 0) {
      std::vector<double> all(count * n), ends(count * n);
      for (std::size_t p = 0; p < count; ++p)
        for (std::size_t i = 0; i < n; ++i)
          all[p * n + i] = state[i] + (p > 0 && (p - 1) % n == i ? (p <= n ? 1e-3 : -1e-3) * sizes[i] : 0.0);
      const auto before = allocations();
      model.advance_all(all.data(), static_cast<int>(count), from.data(), to.data(), sheet.sample_period, ends.data());
      EXPECT_EQ(allocations(), before);
      for (std::size_t p = 0; p < count; ++p) {
        model.advance(&all[p * n], from.data(), to.data(), sheet.sample_period, next.data());
        for (std::size_t i = 0; i < n && sizes[i] > 0; ++i) {
          EXPECT_TRUE(p > 0 || ends[i] == next[i]) << sheet.states[i].name;
          off += std::pow((ends[p * n + i] - next[i]) / sizes[i], 2);
          apart += std::pow((next[i] - ends[i]) / sizes[i], 2);
        }
      }
    }
    model.advance(state.data(), from.data(), to.data(), sheet.sample_period, next.data());
    state.swap(next);
    from.swap(to);
  }
  EXPECT_GT(apart, 0);
  EXPECT_LT(std::sqrt(off), kNear * std::sqrt(apart));
}

// The cooling circuit has forgotten its start at the end of a step.
INSTANTIATE_TEST_SUITE_P(StepModel, StepsOfRig,
                         testing::Values("servo_actuator", "hydraulic_drive", "pump_cylinder", "control_valve"));

}  // namespace
}  // namespace faultline
