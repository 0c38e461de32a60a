// Data alarms of a rig that is sampled every four seconds: what is told, and for how long, follows its period.
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "faultline/alarms/diagnosis.h"
#include "faultline/rig/simulator.h"
#include "own_rigs.h"

namespace faultline {
namespace {

struct Told {
  AlarmReport report;
  int restarts = 0;
  const Alarm* data(AlarmLevel level) const {
    for (const Alarm& alarm : report.alarms)
      if (alarm.kind == AlarmKind::data && alarm.level == level) return &alarm;
    return nullptr;
  }
};

class SlowData : public ::testing::Test {
 protected:
  // Rows of a healthy run, each changed by `change`; those for which it says false are lost.
  template <class Change>
  Told diagnosed(Change&& change) const {
    SimulationSetup setup;
    const Recording run = simulate(sheet_, setup, 800);
    Diagnosis diagnosis(sheet_);
    EstimatorStage filter(sheet_, sheet_.estimators[0]);
    Estimate estimate;
    Told told;
    for (std::size_t row = 0; row < run.rows(); ++row) {
      Sample sample = run.sample(row);
      if (!change(row, sample)) continue;
      diagnosis.process(sample);
      filter.process(sample, estimate);
      told.restarts += estimate.restarted;
    }
    told.report = diagnosis.report();
    return told;
  }

  Datasheet sheet_ = own_rig("two_tanks");
};

TEST_F(SlowData, AMissingReadingIsOneAlarmThatEnds) {
  const Told told = diagnosed([](std::size_t row, Sample& sample) {
    if (row == 100 || row == 102 || row == 104) sample.values[1] = std::numeric_limits<double>::quiet_NaN();
    return true;
  });
  ASSERT_EQ(told.report.alarms.size(), 1u);
  const Alarm* alarm = told.data(AlarmLevel::error);
  ASSERT_NE(alarm, nullptr);
  EXPECT_EQ(alarm->since, 400);
  EXPECT_EQ(alarm->until, 416);
  EXPECT_FALSE(alarm->active);
  EXPECT_EQ(told.restarts, 1);
}

TEST_F(SlowData, LostSamplesAreNotSilenceAndStopNoFilter) {
  const Told told = diagnosed([](std::size_t row, Sample&) { return row != 100 && row != 101; });
  EXPECT_TRUE(told.report.alarms.empty());
  EXPECT_EQ(told.restarts, 1);
}

TEST_F(SlowData, SilenceIsToldAfterAFewSamples) {
  const Told told = diagnosed([](std::size_t row, Sample&) { return row < 100 || row >= 105; });
  const Alarm* alarm = told.data(AlarmLevel::stale);
  ASSERT_NE(alarm, nullptr);
  EXPECT_EQ(alarm->since, 99 * 4 + 13);  // three periods and a second after the last sample
  EXPECT_EQ(alarm->until, 105 * 4);
}

}  // namespace
}  // namespace faultline
