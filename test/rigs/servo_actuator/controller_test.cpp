// Controllers: every registered one resets completely and keeps its limits; the servo actuator's laws against the
// datasheet.
#include "faultline/rig/controller.h"

#include <gtest/gtest.h>

#include "faultline/signal/error.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

std::unique_ptr<Controller> made(const std::string& profile, std::uint64_t seed = 1) {
  return make_controller(servo(), servo().profile(profile), seed);
}

std::vector<double> rest() {
  std::vector<double> channels(servo().channels.size(), 0);
  channels[column("supply_pressure")] = 6.89e6;
  return channels;
}

TEST(Controller, EveryProfileOfTheSheetMakesOne) {
  for (const Profile& profile : servo().profiles)
    EXPECT_NE(make_controller(servo(), profile, 1), nullptr) << profile.name;
}

TEST(Controller, ResetIsComplete) {
  for (const Profile& profile : servo().profiles) {
    const auto controller = make_controller(servo(), profile, 9);
    std::vector<std::vector<double>> first;
    for (int pass = 0; pass < 2; ++pass) {
      controller->reset();
      for (int k = 0; k < 3000; ++k) {
        auto channels = rest();
        channels[column("position")] = 0.01 * std::sin(0.003 * k);
        channels[column("velocity")] = 0.03 * std::cos(0.003 * k);
        controller->step(k * 1e-3, channels.data());
        if (pass == 0)
          first.push_back(channels);
        else
          ASSERT_EQ(channels, first[static_cast<std::size_t>(k)]) << profile.name << " step " << k;
      }
    }
  }
}

TEST(Controller, CommandsStayInRangeAndOnTheConvertersSteps) {
  for (const Profile& profile : servo().profiles) {
    const auto controller = make_controller(servo(), profile, 2);
    controller->reset();
    for (int k = 0; k < 2000; ++k) {
      auto channels = rest();
      // Wild measurements: the law asks for far more than there is.
      channels[column("position")] = k % 7 < 3 ? 0.12 : -0.12;
      channels[column("velocity")] = k % 5 < 2 ? 0.8 : -0.8;
      channels[column("load_pressure")] = k % 3 == 0 ? 7e6 : -7e6;
      controller->step(k * 1e-3, channels.data());
      const double command = channels[column("valve_command")];
      ASSERT_LE(std::abs(command), 10.0 + 3.05e-4) << profile.name;
      const double steps = command / 3.05e-4;
      ASSERT_NEAR(steps, std::round(steps), 1e-6) << profile.name;
    }
  }
}

TEST(PositionControl, HoldsStillWhereItStands) {
  const auto controller = made("standstill");
  controller->reset();
  for (int k = 0; k < 100; ++k) {
    auto channels = rest();
    controller->step(k * 1e-3, channels.data());
    EXPECT_EQ(channels[column("valve_command")], 0);
    EXPECT_EQ(channels[column("position_reference")], 0);
  }
}

TEST(PositionControl, FirstStepFollowsTheLaw) {
  // At rest and off the set point by e, with the reference still there: n = -k_f (A P_L + k_p e), i = n/(A K
  // sqrt(margin)/C).
  const auto controller = made("standstill");
  controller->reset();
  auto channels = rest();
  controller->step(0, channels.data());
  channels = rest();
  channels[column("position")] = 1e-3;
  channels[column("load_pressure")] = 5e5;
  channels[column("velocity")] = 0.01;
  channels[column("load_force")] = 20;
  controller->step(1e-3, channels.data());
  const double area = 6.33e-4, compliance = 1.14e-12;
  const double wanted = -100 * 0.01 - 2e5 * 1e-3 + 20;
  const double n = area * area * 0.01 / compliance - 2e5 * 0.01 - 30 * (area * 5e5 - wanted);
  ASSERT_LT(n, 0);
  const double voltage = n / (area * 1.47e-8 * std::sqrt(6.89e6 + 5e5) / compliance);
  EXPECT_NEAR(channels[column("valve_command")], voltage, 1.6e-4);  // half a step of the converter
}

TEST(PositionControl, ReferenceIsSlewLimitedAndArrives) {
  const auto controller = made("cycle");
  controller->reset();
  double last = 0, fastest = 0, highest = -1;
  for (int k = 0; k < 3000; ++k) {
    auto channels = rest();
    controller->step(k * 1e-3, channels.data());
    const double now = channels[column("position_reference")];
    if (k > 0) fastest = std::max(fastest, std::abs(now - last) / 1e-3);
    highest = std::max(highest, now);
    last = now;
  }
  EXPECT_LE(fastest, 0.3 * 1.001);
  EXPECT_GT(fastest, 0.1);
  EXPECT_NEAR(highest, 0.06, 1e-3);
}

TEST(OpenLoop, IsTheRawSignalMinusTheCentring) {
  const auto controller = made("prbs", 4);
  const auto raw = make_excitation("prbs", servo().profile("prbs").settings, 4);
  controller->reset();
  for (int k = 0; k < 3000; ++k) {
    auto channels = rest();
    channels[column("position")] = 0.02 * std::sin(0.01 * k);
    controller->step(k * 1e-3, channels.data());
    EXPECT_NEAR(channels[column("valve_command")], raw->value(k * 1e-3) - 18 * channels[column("position")], 1.6e-4)
        << k;
    EXPECT_EQ(channels[column("position_reference")], 0);
  }
}

TEST(Controller, UnknownControllerIsRefused) {
  Profile profile = servo().profile("square");
  profile.controller = "fuzzy";
  EXPECT_THROW(make_controller(servo(), profile, 1), InputError);
}

}  // namespace
}  // namespace faultline
