// The bench's sequencer: slew limits, interlock, one and two raw set points.
#include <gtest/gtest.h>

#include "faultline/signal/error.h"
#include "rigs/cooling_circuit/runs.h"

namespace faultline {
namespace {

const Profile& profile(const std::string& name) { return cooling().profile(name); }

TEST(Sequencer, KeepsToSlewAndInterlockInEveryProfile) {
  const std::size_t u = cooling_column("bench_valve_command"), h = cooling_column("heat_load_command");
  for (const Profile& p : cooling().profiles) {
    const auto controller = make_controller(cooling(), p, 5);
    controller->reset();
    std::vector<double> channels(cooling().channels.size(), 0.0);
    double last_u = 0, last_h = 0, allowed = 0;
    for (int k = 0; k < 60000; ++k) {
      controller->step(1e-3 * k, channels.data());
      ASSERT_GE(channels[u], 0);
      ASSERT_LE(channels[u], 1);
      ASSERT_GE(channels[h], 0);
      ASSERT_LE(channels[h], 1.6 * channels[u] + 1e-12) << p.name << " at " << 1e-3 * k;
      if (k > 0) {
        ASSERT_LE(std::abs(channels[u] - last_u), 5e-3 + 1e-12) << p.name;
        // The interlock may cut the heat faster than its own slew: as fast as the valve closes.
        ASSERT_LE(channels[h] - last_h, 10e-3 + 1e-12) << p.name;
        ASSERT_GE(channels[h] - last_h, -std::max(10e-3, 1.6 * 5e-3) - 1e-12) << p.name;
      }
      last_u = channels[u];
      last_h = channels[h];
      allowed = std::max(allowed, last_h);
    }
    EXPECT_GT(allowed, 0.5) << p.name;
  }
}

TEST(Sequencer, InterlockHoldsTheHeatDown) {
  Profile p = profile("valve_steps");
  p.shape = "constant";
  p.settings = Settings("test", {{"value", 0.2}}, {}, {});
  const auto controller = make_controller(cooling(), p, 1);
  controller->reset();
  std::vector<double> channels(cooling().channels.size(), 0.0);
  for (int k = 0; k < 4000; ++k) controller->step(1e-3 * k, channels.data());
  EXPECT_NEAR(channels[cooling_column("heat_load_command")], 0.32, 1e-12);  // asked for 0.8
}

TEST(Sequencer, BothSetPointsMoveOnTheirOwn) {
  const auto controller = make_controller(cooling(), profile("both_steps"), 3);
  controller->reset();
  std::vector<double> channels(cooling().channels.size(), 0.0);
  int together = 0, valve = 0, heat = 0;
  double last_u = 0, last_h = 0;
  for (int k = 0; k < 60000; ++k) {
    controller->step(1e-3 * k, channels.data());
    const double u = channels[cooling_column("bench_valve_command")], h = channels[cooling_column("heat_load_command")];
    const bool moves_u = u != last_u, moves_h = h != last_h;
    together += moves_u && moves_h;
    valve += moves_u;
    heat += moves_h;
    last_u = u;
    last_h = h;
  }
  EXPECT_GT(valve, 1000);
  EXPECT_GT(heat, 500);
  EXPECT_LT(together, heat / 2);
}

TEST(Sequencer, ASecondSetPointBelongsToItsController) {
  Profile p = profile("both_steps");
  p.controller = "throttling";
  EXPECT_THROW(make_controller(cooling(), p, 1), InputError);
  p = profile("valve_steps");
  p.controller = "throttled_firing";
  EXPECT_THROW(make_controller(cooling(), p, 1), InputError);
}

}  // namespace
}  // namespace faultline
