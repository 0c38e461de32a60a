// The three loops of the control valve against their printed laws, worked out beside them step by step.
#include <gtest/gtest.h>

#include <algorithm>

#include "faultline/signal/error.h"
#include "rigs/control_valve/runs.h"

namespace faultline {
namespace {

constexpr std::uint64_t kSeed = 5;

std::unique_ptr<Controller> made(const std::string& profile) {
  auto controller = make_controller(valve(), valve().profile(profile), kSeed);
  controller->reset();
  return controller;
}

TEST(ValveLoops, SpoolControllerFollowsItsLaw) {
  // Measurements that reach both limits of the voltage: the integral waits there.
  const auto controller = made("valve_steps");
  std::vector<double> channels(valve().channels.size(), 0.0);
  double filtered = 0, integral = 0, waited = 0;
  ASSERT_DOUBLE_EQ(controller->inner_period(), 0.001);
  for (int k = 0; k < 3000; ++k) {
    const double set_point = 0.5 + 0.4 * std::sin(0.004 * k), spool = 0.5 + 0.45 * std::sin(0.0041 * k + 0.3);
    channels[valve_column("spool_setpoint")] = set_point;
    channels[valve_column("spool_position")] = spool;
    controller->inner_step(k * 1e-3, channels.data());
    if (k == 0) filtered = spool;
    const double last = filtered, e = set_point - spool;
    filtered += (spool - filtered) * (1 - std::exp(-0.001 / 0.005));
    const double v = 1.98 + 4 * e + integral + 0.01 * -(filtered - last) / 0.001;
    if ((v > 4.5 && e > 0) || (v < 0 && e < 0))
      ++waited;
    else
      integral += 80 * e * 0.001;
    ASSERT_NEAR(channels[valve_column("coil_voltage")], std::clamp(v, 0.0, 4.5), 1e-9) << k;
  }
  EXPECT_GT(waited, 100);
}

TEST(ValveLoops, PositionAndFlowFollowTheirLawsOnWhatWasRecorded) {
  // Every row's set points from the same row's noisy, rounded measurements.
  const Recording r = simulate(valve(), off_nominal_valve("steps", 3), 60);
  const auto at = [&](std::size_t k, const char* name) { return r.at(k, valve_column(name)); };
  double integral = 0, wanted = 0;
  for (std::size_t k = 0; k < r.rows(); ++k) {
    if (k % 10 == 0) {
      const double e = at(k, "flow_setpoint") - at(k, "flow");
      if (k == 0) integral = at(k, "valve_position") - 8 * e;
      const double v = 8 * e + integral;
      if (!((v > 1 && e > 0) || (v < 0 && e < 0))) integral += 16 * e * 0.1;
      wanted = std::clamp(8 * e + integral, 0.0, 1.0);
    }
    ASSERT_NEAR(at(k, "valve_setpoint"), wanted, 1e-9) << k;
    ASSERT_NEAR(at(k, "spool_setpoint"), std::clamp(0.5 + 6 * (wanted - at(k, "valve_position")), 0.0, 1.0), 1e-9) << k;
  }
}

TEST(ValveLoops, DemandChangesEveryTenthOfASecondAndIsClipped) {
  const Recording r = simulate(valve(), valve_setup("paper", {}, true), 200);
  const std::size_t c = valve_column("flow_setpoint");
  double squares = 0;
  int held = 0, count = 0;
  for (std::size_t k = 1; k < r.rows(); ++k) {
    const double step = (r.at(k, c) - r.at(k - 1, c)) / 0.028;
    if (k % 10 != 0) {
      ASSERT_EQ(step, 0) << k;
      ++held;
    } else if (std::abs(step) < 0.02) {  // not a new level
      squares += step * step;
      ++count;
    }
  }
  EXPECT_GT(held, 17000);
  // First-order noise of 0.005 with 1 s: from one to the next 0.005 sqrt(2 (1 - exp(-0.1))).
  EXPECT_NEAR(std::sqrt(squares / count), 0.005 * std::sqrt(2 * (1 - std::exp(-0.1))), 1e-4);
  Profile profile = valve().profile("valve_steps");
  profile.shape = "constant";
  profile.settings = Settings("test", {{"value", 1.5}}, {}, {});
  const auto controller = make_controller(valve(), profile, kSeed);
  controller->reset();
  std::vector<double> channels(valve().channels.size(), 0.0);
  controller->step(0, channels.data());
  EXPECT_DOUBLE_EQ(channels[valve_column("valve_setpoint")], 0.98);
  EXPECT_EQ(channels[valve_column("flow_setpoint")], 0);
}

TEST(OpenScheme, MovesTheVoltageAlone) {
  const Recording r = simulate(valve(), valve_setup("open_multisine"), 60);
  double lowest = 10, highest = 0;
  for (std::size_t k = 0; k < r.rows(); ++k) {
    for (const char* unused : {"flow_setpoint", "valve_setpoint", "spool_setpoint"})
      ASSERT_EQ(r.at(k, valve_column(unused)), 0);
    lowest = std::min(lowest, r.at(k, valve_column("coil_voltage")));
    highest = std::max(highest, r.at(k, valve_column("coil_voltage")));
  }
  // 1.98 + 0.25 (0.1..0.9 - 0.5) within 0.03 V and the demand's noise.
  EXPECT_GT(lowest, 1.98 - 0.1 - 0.035);
  EXPECT_LT(highest, 1.98 + 0.1 + 0.035);
  EXPECT_GT(highest - lowest, 0.12);
}

TEST(Simulator, RecordsTheMeanOfALoopInsideTheRigWithItsNoise) {
  // The same run with and without noise in the recording alone cannot be had: the loop sees the noise. What it records
  // is rounded, and at a held valve as noisy as the channel says.
  const Recording r = simulate(valve(), valve_setup("paper", {}, true), 100);
  const std::size_t c = valve_column("coil_voltage");
  for (std::size_t k = 0; k < r.rows(); ++k) {
    ASSERT_GE(r.at(k, c), 0);
    ASSERT_LE(r.at(k, c), 4.5);
    ASSERT_NEAR(r.at(k, c) / 0.001, std::round(r.at(k, c) / 0.001), 1e-6);
  }
}

TEST(Simulator, ResetGivesTheSameRowsOfAnInnerLoop) {
  SimulationSetup setup = off_nominal_valve("steps", 4);
  Simulator simulator(valve(), setup);
  std::vector<std::vector<double>> first;
  for (int k = 0; k < 500; ++k) first.push_back(simulator.step().values);
  simulator.reset();
  for (int k = 0; k < 500; ++k) ASSERT_EQ(simulator.step().values, first[static_cast<std::size_t>(k)]) << k;
}

TEST(Simulator, InnerLoopMustFitTheSamplePeriod) {
  Datasheet sheet = valve();
  sheet.controllers.at("valve").set("spool_period", 0.003);
  EXPECT_THROW(Simulator(sheet, valve_setup("valve_steps")), InputError);
}

}  // namespace
}  // namespace faultline
