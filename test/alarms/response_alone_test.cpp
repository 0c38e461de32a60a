// A rig whose only estimator speaks when it has news, and one where such a stage stands first: the data are complete
// and must not be called late; alarms come all the same.
#include <gtest/gtest.h>

#include "faultline/alarms/diagnosis.h"
#include "faultline/alarms/estimate_join.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

const StageSpec& responses() {
  for (const StageSpec& stage : servo().estimators)
    if (stage.type == "fault_response") return stage;
  return servo().estimators.front();
}

Datasheet with_stages(const std::vector<StageSpec>& stages) {
  Datasheet sheet = servo();
  sheet.estimators = stages;
  sheet.detectors.clear();
  return sheet;
}

AlarmReport diagnosed(const Datasheet& sheet, const std::string& effect) {
  SimulationSetup setup = off_nominal("random", 36);
  if (!effect.empty()) setup.effects.push_back(parse_effect(effect));
  const Recording run = simulate(servo(), setup, 12);
  Diagnosis diagnosis(sheet);
  for (std::size_t k = 0; k < run.rows(); ++k) diagnosis.process(run.sample(k));
  EXPECT_DOUBLE_EQ(diagnosis.report().time, run.time.back());
  return diagnosis.report();
}

TEST(ResponseAlone, CompleteDataAreNotLate) {
  const AlarmReport report = diagnosed(with_stages({responses()}), "");
  EXPECT_EQ(report.alarms.size(), 0u) << report.alarms.front().text;
}

TEST(ResponseAlone, AFaultIsNamed) {
  const AlarmReport report =
      diagnosed(with_stages({responses()}), "orifice_leakage@flow.chamber_a_chamber_b:coefficient=2e-8,from=4");
  ASSERT_EQ(report.alarms.size(), 1u);
  EXPECT_EQ(report.alarms.front().port, "flow.chamber_a_chamber_b");
  EXPECT_NEAR(report.alarms.front().since, 4, 2);
  EXPECT_LT(report.alarms.front().raised, 8);
}

TEST(ResponseAlone, ItsPlaceInTheListDoesNotMatter) {
  const StageSpec& filter = servo().estimators.front();
  const std::string leak = "orifice_leakage@flow.chamber_a_chamber_b:coefficient=2e-8,from=4";
  const AlarmReport first = diagnosed(with_stages({responses(), filter}), leak),
                    last = diagnosed(with_stages({filter, responses()}), leak);
  ASSERT_EQ(first.alarms.size(), 1u) << first.alarms.front().text;
  ASSERT_EQ(last.alarms.size(), 1u);
  EXPECT_EQ(first.alarms.front().text, last.alarms.front().text);
  EXPECT_EQ(first.alarms.front().raised, last.alarms.front().raised);
}

// A judgement that is repeated at every sample counts once.
TEST(ResponseAlone, ConfirmationCountsJudgementsNotSamples) {
  Datasheet sheet = with_stages({responses()});
  sheet.isolators.resize(1);
  const std::string leak = "orifice_leakage@flow.chamber_a_chamber_b:coefficient=2e-8,from=4";
  const AlarmReport once = diagnosed(sheet, leak);
  sheet.isolators.front().settings.set("confirm", 2.0);
  const AlarmReport twice = diagnosed(sheet, leak);
  ASSERT_EQ(once.alarms.size(), 1u);
  ASSERT_EQ(twice.alarms.size(), 1u);
  EXPECT_NEAR(twice.alarms.front().raised - once.alarms.front().raised, 2, 0.01);  // s, from stretch to stretch
}

TEST(ResponseAlone, LiveItSpeaksAtEverySampleToo) {
  EXPECT_EQ(occasional_stages(with_stages({responses()})), std::vector<bool>{false});
  const StageSpec& filter = servo().estimators.front();
  // The first stage of a rig tells the time and the state of the channels, whatever it is.
  EXPECT_EQ(occasional_stages(with_stages({responses(), filter})), (std::vector<bool>{false, false}));
  EXPECT_EQ(occasional_stages(with_stages({filter, responses()})), (std::vector<bool>{false, true}));
}

}  // namespace
}  // namespace faultline
