// The even grid of a recording: its period, jitter, rows that are missing, breaks.
#include "faultline/segments/even_rows.h"

#include <gtest/gtest.h>

#include <cmath>

#include "faultline/numerics/random.h"
#include "faultline/segments/segmented_run.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

Recording run_of(double seconds) { return simulate(servo(), servo_setup("multisine"), seconds); }

Recording without(const Recording& recording, std::size_t first, std::size_t count) {
  Recording result;
  result.rig = recording.rig;
  result.channels = recording.channels;
  for (std::size_t k = 0; k < recording.rows(); ++k)
    if (k < first || k >= first + count) result.append(recording.sample(k));
  return result;
}

TEST(FittedPeriod, IsTheRunsOwnUnlessTheClocksAreTheSame) {
  Recording run = run_of(2);
  for (std::size_t k = 0; k < run.rows(); ++k) run.time[k] = 1.15e-3 * static_cast<double>(k);
  EXPECT_NEAR(fitted_period(servo(), run), 1.15e-3, 1e-9);
  EXPECT_EQ(cut_run(servo(), "a", run, 0.23).segment, 200u);
  for (std::size_t k = 0; k < run.rows(); ++k) run.time[k] = 1.0005e-3 * static_cast<double>(k);
  EXPECT_EQ(fitted_period(servo(), run), servo().sample_period);
}

TEST(EvenRows, TakeJitterOfTheStampsAsJitter) {
  for (const double size : {0.1e-3, 0.2e-3, 0.3e-3}) {
    Recording run = run_of(4);
    Random random(7);
    for (double& t : run.time) t += size * (2 * random.uniform() - 1);
    EXPECT_EQ(fitted_period(servo(), run), servo().sample_period);
    const SegmentedRun cut = cut_run(servo(), "a.bag", run, 0.5);
    EXPECT_EQ(cut.segments(), 8u) << size;
    EXPECT_EQ(cut.remark, "") << size;
  }
}

TEST(EvenRows, PutSingleRowsIn) {
  const Recording run = run_of(2);
  const SegmentedRun cut = cut_run(servo(), "a.bag", without(run, 700, 2), 0.5);
  ASSERT_EQ(cut.recording.rows(), run.rows());
  EXPECT_EQ(cut.segments(), 4u);
  EXPECT_NE(cut.remark.find("2 rows were put in"), std::string::npos) << cut.remark;
  EXPECT_NEAR(cut.recording.time[700], 0.7, 1e-9);
  EXPECT_EQ(cut.recording.sequence[701], run.sequence[701]);
  EXPECT_TRUE(std::isnan(cut.recording.at(700, column("position"))));
  const std::size_t command = column("valve_command");
  const double before = run.at(699, command), after = run.at(702, command);
  EXPECT_NEAR(cut.recording.at(700, command), before + (after - before) / 3, 1e-12);
}

TEST(EvenRows, BreakWhereMoreIsMissingOrTimeRunsBackwards) {
  const Recording run = run_of(2);
  EvenRows even = even_rows(servo(), without(run, 700, 4), 1e-3, {});
  EXPECT_EQ(even.breaks, std::vector<std::size_t>{700});
  EXPECT_EQ(even.filled, 0u);
  EXPECT_NE(even.first_break.find("0.005 s between the samples at 0.704 s"), std::string::npos) << even.first_break;
  Recording back = run;
  for (std::size_t k = 900; k < back.rows(); ++k) back.time[k] -= 0.3;
  EXPECT_EQ(even_rows(servo(), back, 1e-3, {}).breaks, std::vector<std::size_t>{900});
  Recording twice = run;
  twice.time[1200] = twice.time[1199];
  even = even_rows(servo(), twice, 1e-3, {});
  EXPECT_EQ(even.breaks.front(), 1200u);
}

}  // namespace
}  // namespace faultline
