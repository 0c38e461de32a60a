// What is filled in where a datasheet holds the rig alone: it runs, it follows the rig's time scales, it reads back.
#include <fstream>
#include <sstream>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "faultline/rig/default_sheet.h"
#include "faultline/rig/simulator.h"
#include "faultline/rig/time_scales.h"
#include "own_rigs.h"

namespace faultline {
namespace {

std::string text_of(const std::string& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

Datasheet read_text_of(const std::string& text) {
  const std::string file = ::testing::TempDir() + "filled.yaml";
  std::ofstream(file) << text;
  return read_datasheet(file);
}

std::vector<std::string> names(const std::vector<StageSpec>& stages) {
  std::vector<std::string> result;
  for (const StageSpec& stage : stages) result.push_back(stage.name);
  return result;
}

class OwnRig : public ::testing::TestWithParam<std::string> {};

TEST_P(OwnRig, RunsEveryProfileWithinItsRanges) {
  const Datasheet sheet = own_rig(GetParam());
  const TimeScales scales = time_scales(sheet);
  ASSERT_EQ(sheet.profiles.size(), 3u);
  for (const Profile& profile : sheet.profiles) {
    EXPECT_GE(profile.duration, 60 * scales.slowest_s);
    EXPECT_GE(profile.duration, 499 * sheet.sample_period);
    SimulationSetup setup;
    setup.profile = profile.name;
    setup.noise = false;
    const Recording run = simulate(sheet, setup, profile.duration);
    double low = 1e300, high = -1e300;
    for (std::size_t row = 0; row < run.rows(); ++row)
      for (std::size_t c = 0; c < run.columns(); ++c) {
        const Channel& channel = run.channels[c];
        ASSERT_TRUE(std::isfinite(run.at(row, c)));
        ASSERT_GE(run.at(row, c), channel.minimum) << profile.name << " " << channel.name;
        ASSERT_LE(run.at(row, c), channel.maximum) << profile.name << " " << channel.name;
        if (channel.role != Role::command) continue;
        low = std::min(low, run.at(row, c));
        high = std::max(high, run.at(row, c));
      }
    EXPECT_GT(high - low, 4) << profile.name;  // of 10 V
  }
}

TEST_P(OwnRig, ReadsBackWhatWasFilledIn) {
  const Datasheet sheet = own_rig(GetParam());
  const Datasheet again = read_text_of(text_of(own_rig_file(GetParam())) + defaulted_text(sheet));
  EXPECT_EQ(again.defaulted, std::set<std::string>{"identify"});
  ASSERT_EQ(names(again.estimators), names(sheet.estimators));
  ASSERT_EQ(names(again.detectors), names(sheet.detectors));
  ASSERT_EQ(names(again.isolators), names(sheet.isolators));
  for (std::size_t i = 0; i < sheet.estimators.size(); ++i)
    EXPECT_EQ(again.estimators[i].settings.texts(), sheet.estimators[i].settings.texts());
  for (std::size_t i = 0; i < sheet.detectors.size(); ++i)
    EXPECT_EQ(again.detectors[i].settings.texts(), sheet.detectors[i].settings.texts());
  ASSERT_EQ(again.profiles.size(), sheet.profiles.size());
  for (std::size_t i = 0; i < sheet.profiles.size(); ++i) {
    SimulationSetup setup;
    setup.profile = sheet.profiles[i].name;
    EXPECT_EQ(simulate(again, setup, 50 * sheet.sample_period).values,
              simulate(sheet, setup, 50 * sheet.sample_period).values);
  }
}

INSTANTIATE_TEST_SUITE_P(Rigs, OwnRig, ::testing::Values("two_tanks", "fast_valve"));

TEST(Defaults, DetectorsOfWhatIsMeasured) {
  EXPECT_EQ(names(own_rig("two_tanks").detectors),
            (std::vector<std::string>{"model_fit", "frozen_lower_level", "noisy_lower_level"}));
  // Of an input that is measured only whether it is frozen: nothing foresees how fast it is moved.
  const std::vector<std::string> valve = names(own_rig("fast_valve").detectors);
  EXPECT_EQ(valve.size(), 6u);
  for (const Channel& channel : own_rig("fast_valve").channels)
    EXPECT_EQ(std::count(valve.begin(), valve.end(), "noisy_" + channel.name), channel.role == Role::output)
        << channel.name;
}

double of_responses(const Datasheet& sheet, const char* key) {
  return sheet.estimators[sheet.estimator("responses")].settings.number(key, 0, 1e9);
}

// A stretch must be able to show a fault, and a run of the datasheet's own must hold some.
TEST(Defaults, StretchesFitTheRigAndItsRuns) {
  const Datasheet tanks = own_rig("two_tanks"), valve = own_rig("fast_valve");
  EXPECT_EQ(of_responses(tanks, "inflation"), 5);  // few readings
  EXPECT_GT(of_responses(valve, "inflation"), 5);
  EXPECT_LE(of_responses(valve, "inflation"), 30);
  const double wanted = of_responses(valve, "segment");
  const Datasheet shorter = read_text_of(text_of(own_rig_file("fast_valve")) +
                                         fmt::format("profiles:\n  - {{name: own, duration: {:g}, meaning: short, "
                                                     "commands: {{coil_voltage: {{shape: steps, low: 2, high: 8, "
                                                     "shortest: 0.01, longest: 0.1}}}}}}\n",
                                                     24 * wanted));
  EXPECT_LT(of_responses(shorter, "segment"), wanted);
}

TEST(Defaults, ParametersWithATolerance) {
  const Datasheet sheet = own_rig("two_tanks");
  EXPECT_EQ(sheet.defaulted.count("identify"), 1u);
  for (const Parameter& p : sheet.parameters) EXPECT_EQ(p.identify, p.tolerance > 0) << p.name;
}

TEST(Defaults, InputWithoutAValueStandsInTheMiddle) {
  std::string text = text_of(own_rig_file("fast_valve"));
  const auto begin = text.find("inputs:");
  text.erase(begin, text.find("ports:") - begin);
  const Datasheet sheet = read_text_of(text);
  ASSERT_EQ(sheet.inputs.size(), 1u);
  EXPECT_EQ(sheet.inputs[0].level.value, 1e7);
  EXPECT_EQ(sheet.defaulted.count("inputs"), 1u);
}

TEST(Defaults, GivenButEmptyIsWanted) {
  const Datasheet sheet = read_text_of(text_of(own_rig_file("two_tanks")) + "detectors: []\nisolators: []\n");
  EXPECT_TRUE(sheet.detectors.empty());
  EXPECT_TRUE(sheet.isolators.empty());
  EXPECT_EQ(sheet.estimators.size(), 2u);
}

TEST(Defaults, OwnEstimatorsKeepTheirDetectors) {
  const Datasheet sheet = read_text_of(text_of(own_rig_file("two_tanks")) +
                                       "estimators:\n  - {name: own, type: extended_kalman, model: rig_model}\n");
  EXPECT_EQ(sheet.estimators.size(), 1u);
  EXPECT_TRUE(sheet.detectors.empty());
  EXPECT_TRUE(sheet.isolators.empty());  // no responses to read
}

TEST(Defaults, AProfileIsEitherControlledOrDriven) {
  const std::string text = text_of(own_rig_file("two_tanks"));
  const auto with = [&](const std::string& profile) { return read_text_of(text + "profiles:\n  - " + profile + "\n"); };
  EXPECT_EQ(with("{name: hold, duration: 40, meaning: x, commands: {pump_voltage: {shape: constant, value: 5}}}")
                .profiles[0]
                .commands[0]
                .shape,
            "constant");
  EXPECT_THROW(with("{name: hold, duration: 40, meaning: x, shape: constant, value: 5}"), std::exception);
  EXPECT_THROW(with("{name: hold, duration: 40, meaning: x, commands: {lower_level: {shape: constant, value: 5}}}"),
               std::exception);
  EXPECT_THROW(with("{name: hold, duration: 40, meaning: x, commands: {pump_voltage: {shape: constant}}}"),
               std::exception);
}

}  // namespace
}  // namespace faultline
