// A rig of equations and a datasheet, diagnosed by what is filled in: quiet while it is healthy, and a fault is named
// or at least its place.
#include <gtest/gtest.h>

#include <cmath>

#include "faultline/alarms/diagnosis.h"
#include "faultline/estimators/process_model.h"
#include "faultline/gap/normal_gap.h"
#include "faultline/rig/simulator.h"
#include "faultline/segments/segment_length.h"
#include "own_rigs.h"

namespace faultline {
namespace {

Recording run_of(const Datasheet& sheet, const std::string& effect, std::uint64_t seed) {
  SimulationSetup setup;
  setup.seed = seed;
  setup.parameters = draw_parameters(sheet, seed);
  if (!effect.empty()) setup.effects.push_back(parse_effect(effect));
  return simulate(sheet, setup, sheet.profiles.front().duration);
}

AlarmReport diagnosed(const Datasheet& sheet, const Recording& run) {
  Diagnosis diagnosis(sheet);
  for (std::size_t row = 0; row < run.rows(); ++row) diagnosis.process(run.sample(row));
  return diagnosis.report();
}

std::string told(const AlarmReport& report) {
  std::string text;
  for (const Alarm& alarm : report.alarms) text += alarm.text + "; ";
  return text;
}

TEST(OwnRigDiagnosis, HealthyTanksAreQuiet) {
  const Datasheet sheet = own_rig("two_tanks");
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const AlarmReport report = diagnosed(sheet, run_of(sheet, "", seed));
    EXPECT_TRUE(report.alarms.empty()) << seed << ": " << told(report);
  }
}

TEST(OwnRigDiagnosis, HealthyValveIsQuiet) {
  const Datasheet sheet = own_rig("fast_valve");
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const AlarmReport report = diagnosed(sheet, run_of(sheet, "", seed));
    EXPECT_TRUE(report.alarms.empty()) << seed << ": " << told(report);
  }
}

TEST(OwnRigDiagnosis, ARigOfManyStatesIsWatchedWithoutAFilter) {
  const Datasheet sheet = own_rig("long_chain");
  ASSERT_GT(sheet.states.size(), static_cast<std::size_t>(kMaximumStates));
  EXPECT_EQ(sheet.estimators.front().type, "channels");
  EXPECT_TRUE(diagnosed(sheet, run_of(sheet, "", 1)).alarms.empty());
  Recording run = run_of(sheet, "", 1);
  for (std::size_t row = 301; row < 340; ++row) run.values[row * run.columns() + 1] = run.at(300, 1);
  const AlarmReport report = diagnosed(sheet, run);
  ASSERT_FALSE(report.alarms.empty());
  EXPECT_EQ(report.alarms.front().text, "end_voltage: this transducer is stuck");
}

// What is normal comes from the datasheet's tolerances, where it does not say so itself.
TEST(OwnRigDiagnosis, TheLiveGapOfTanksLeavesNormalAtAFaultOnly) {
  Datasheet sheet = own_rig("two_tanks");
  ASSERT_TRUE(sheet.normal_gap.empty());
  sheet.normal_gap = simulated_normal_gap(sheet, {}, 2);
  ASSERT_EQ(sheet.normal_gap.size(), 1u);
  const auto leaves = [&](const std::string& effect) {
    SimulationSetup setup;
    setup.seed = 5;
    setup.parameters = draw_parameters(sheet, 5);
    if (!effect.empty()) setup.effects.push_back(parse_effect(effect));
    LiveGap gap(sheet, {});
    const Recording run = simulate(sheet, setup, 24 * live_segment_length(sheet));
    for (std::size_t row = 0; row < run.rows(); ++row) gap.process(run.sample(row));
    EXPECT_TRUE(gap.state().judged) << gap.counts().segments;
    EXPECT_FALSE(std::isnan(gap.state().channels.front().normal));
    return gap.state().left;
  };
  EXPECT_FALSE(leaves(""));
  EXPECT_TRUE(leaves("clogging@restriction.lower_outlet:fraction=0.4"));
}

struct Case {
  const char* rig;
  const char* effect;  // `from` is half the run
  const char* named;
};

class OwnRigFault : public ::testing::TestWithParam<Case> {};

TEST_P(OwnRigFault, IsNamed) {
  const Datasheet sheet = own_rig(GetParam().rig);
  const double half = 0.5 * sheet.profiles.front().duration;
  const std::string effect = std::string(GetParam().effect) + ",from=" + std::to_string(half);
  const AlarmReport report = diagnosed(sheet, run_of(sheet, effect, 3));
  const Alarm* alarm = headline(report);
  ASSERT_NE(alarm, nullptr);
  std::vector<std::string> names = alarm->equivalent;
  names.push_back(alarm->effect + "@" + alarm->port);
  EXPECT_NE(std::find(names.begin(), names.end(), GetParam().named), names.end()) << told(report);
  EXPECT_GT(alarm->since, 0.8 * half);
  EXPECT_TRUE(alarm->active);
}

INSTANTIATE_TEST_SUITE_P(
    Faults, OwnRigFault,
    ::testing::Values(
        Case{"two_tanks", "clogging@restriction.lower_outlet:fraction=0.2", "clogging@restriction.lower_outlet"},
        Case{"two_tanks", "clogging@restriction.upper_outlet:fraction=0.2", "clogging@restriction.upper_outlet"},
        Case{"two_tanks", "orifice_leakage@flow.upper_floor:coefficient=2e-7", "orifice_leakage@flow.upper_floor"},
        Case{"two_tanks", "offset@sensor.lower_level:value=0.03", "offset@sensor.lower_level"},
        Case{"fast_valve", "clogging@restriction.valve:fraction=0.3", "clogging@restriction.valve"},
        Case{"fast_valve", "orifice_leakage@flow.chamber_tank:coefficient=5e-9", "orifice_leakage@flow.chamber_tank"}));

TEST(OwnRigDiagnosis, AStuckTransducerIsNamedAtOnce) {
  const Datasheet sheet = own_rig("two_tanks");
  Recording run = run_of(sheet, "", 2);
  for (std::size_t row = 701; row < run.rows(); ++row) run.values[row * run.columns() + 1] = run.at(700, 1);
  const AlarmReport report = diagnosed(sheet, run);
  bool named = false;
  for (const Alarm& alarm : report.alarms)
    named = named || (alarm.effect == "stuck" && alarm.port == "sensor.lower_level" && alarm.raised < run.time[710]);
  EXPECT_TRUE(named) << told(report);
}

TEST(OwnRigDiagnosis, AReadingAtTheEndOfItsRangeIsNotStuck) {
  const Datasheet sheet = own_rig("two_tanks");
  Recording run = run_of(sheet, "", 1);
  for (std::size_t row = 600; row < 640; ++row) run.values[row * run.columns() + 1] = 0.4;
  for (const Alarm& alarm : diagnosed(sheet, run).alarms) EXPECT_NE(alarm.effect, "stuck");
}

}  // namespace
}  // namespace faultline
