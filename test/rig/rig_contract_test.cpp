// What holds for every rig that this build has equations for: starts at rest, finite derivatives, the same rows for the
// same seed, outputs that fit the channels' ranges, every profile and every named fault simulates.
#include <gtest/gtest.h>

#include "faultline/rig/rig.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

constexpr double kFaultRows = 12000;  // samples, by which every rig has been moved, and fired on

std::vector<std::string> rigs() {
  std::vector<std::string> names;
  for (const RigType& type : rig_types()) names.push_back(type.name);
  return names;
}

class EveryRig : public ::testing::TestWithParam<std::string> {
 protected:
  Datasheet sheet_ = find_datasheet(config_folder(), GetParam());
};

TEST_P(EveryRig, HasPositiveSubstepBelowItsPeriod) {
  const RigType* type = find_rig_type(GetParam());
  EXPECT_GT(type->substep, 0);
  EXPECT_LE(type->substep, sheet_.sample_period);
}

TEST_P(EveryRig, EveryProfileStaysInsideItsChannels) {
  for (const Profile& profile : sheet_.profiles) {
    SimulationSetup setup;
    setup.profile = profile.name;
    setup.noise = false;
    const double duration = std::min(profile.duration, 2000 * sheet_.sample_period);
    const Recording r = simulate(sheet_, setup, duration);
    for (std::size_t k = 0; k < r.rows(); ++k)
      for (std::size_t c = 0; c < r.columns(); ++c) {
        ASSERT_TRUE(std::isfinite(r.at(k, c))) << profile.name << " " << r.channels[c].name << " row " << k;
        ASSERT_GE(r.at(k, c), r.channels[c].minimum - 1e-9)
            << profile.name << " " << r.channels[c].name << " row " << k;
        ASSERT_LE(r.at(k, c), r.channels[c].maximum + 1e-9)
            << profile.name << " " << r.channels[c].name << " row " << k;
      }
  }
}

TEST_P(EveryRig, SameSeedSameRows) {
  SimulationSetup setup;
  setup.seed = 21;
  const double duration = 500 * sheet_.sample_period;
  EXPECT_EQ(simulate(sheet_, setup, duration).values, simulate(sheet_, setup, duration).values);
}

TEST_P(EveryRig, EveryFaultSimulatesAndShows) {
  for (const Fault& fault : sheet_.faults) {
    SimulationSetup setup;
    setup.noise = false;
    setup.profile = fault.profile;
    // Over before it began: the fault at once, at full size. A stuck channel sticks as soon as it may move.
    for (const std::string& text : fault.effects) {
      EffectSpec spec = parse_effect(text);
      spec.from = spec.to = 0;
      if (spec.effect == "stuck") spec.parameters[0] = 0.1;
      setup.effects.push_back(spec);
    }
    for (CommandTable table : fault.commands) {
      double largest = 0;
      for (const double v : table.value) largest = std::max(largest, v);
      table.time = {0};
      table.value = {largest};
      setup.commands.push_back(table);
    }
    SimulationSetup plain;
    plain.noise = false;
    plain.profile = fault.profile;
    const double duration = kFaultRows * sheet_.sample_period;
    const Recording a = simulate(sheet_, setup, duration), b = simulate(sheet_, plain, duration);
    double apart = 0;
    for (std::size_t k = 0; k < a.rows(); ++k)
      for (std::size_t c = 0; c < a.columns(); ++c) {
        ASSERT_TRUE(std::isfinite(a.at(k, c))) << fault.name;
        const double span = a.channels[c].maximum - a.channels[c].minimum;
        const Role role = a.channels[c].role;  // a fault of a sensor that drives the model shows in an input
        if ((role == Role::output || role == Role::input) && span > 0)
          apart = std::max(apart, std::abs(a.at(k, c) - b.at(k, c)) / span);
      }
    EXPECT_GT(apart, 1e-5) << fault.name;
  }
}

INSTANTIATE_TEST_SUITE_P(Rigs, EveryRig, ::testing::ValuesIn(rigs()));

TEST(RigTypes, UnknownRigIsNotThere) {
  EXPECT_EQ(find_rig_type("steam_engine"), nullptr);
  ASSERT_NE(find_rig_type("servo_actuator"), nullptr);
}

}  // namespace
}  // namespace faultline
