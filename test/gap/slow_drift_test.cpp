// A drift that is less than the noise within a segment: held against the integral of the velocity.
#include "faultline/gap/slow_drift.h"

#include <gtest/gtest.h>

#include <cmath>

#include <fmt/ranges.h>

#include "faultline/gap/diagnose_gap.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

std::vector<SegmentedRun> runs_with(const std::vector<std::string>& effects, double segment) {
  std::vector<SegmentedRun> runs;
  for (const char* profile : {"multisine", "random"}) {
    SimulationSetup setup = servo_setup(profile, 305);
    setup.parameters = draw_parameters(servo(), 305);
    for (const std::string& effect : effects) setup.effects.push_back(parse_effect(effect));
    runs.push_back(cut_run(servo(), profile, simulate(servo(), setup, 12), segment));
  }
  return runs;
}

const int kPositionChannel = servo().channel("position"), kVelocityChannel = servo().channel("velocity");

double standard_errors(const std::vector<std::string>& effects) {
  const std::optional<RateApart> apart = rate_apart(runs_with(effects, 1), kPositionChannel, kVelocityChannel);
  return apart ? apart->rate / apart->standard_error : std::nan("");
}

TEST(SlowDrift, KnowsWhichChannelShowsTheRateOfAState) {
  ASSERT_TRUE(rate_channel(servo(), kPositionChannel));
  EXPECT_EQ(*rate_channel(servo(), kPositionChannel), kVelocityChannel);
  EXPECT_FALSE(rate_channel(servo(), kVelocityChannel));
  EXPECT_FALSE(rate_channel(servo(), servo().channel("valve_command")));
}

TEST(SlowDrift, IsTheSlopeOfReadingsLessTheIntegralOfTheirRate) {
  const std::optional<RateApart> apart =
      rate_apart(runs_with({"drift@sensor.position:rate=3e-4"}, 1), kPositionChannel, kVelocityChannel);
  ASSERT_TRUE(apart);
  EXPECT_NEAR(apart->rate, 3e-4, 4 * apart->standard_error);
  EXPECT_LT(apart->standard_error, 5e-5);
  EXPECT_GT(apart->standard_error, 5e-6);
}

// What moves the rig moves both transducers; a scale or a lag of either adds nothing up.
TEST(SlowDrift, IsNotWhatBothTransducersShow) {
  EXPECT_LT(std::abs(standard_errors({})), 4);
  for (const char* effect : {"offset@command.valve_command:value=0.05", "scale@sensor.position:factor=1.05",
                             "lag@sensor.velocity:time_constant=0.005", "load_force@force.piston:constant=200"})
    EXPECT_LT(std::abs(standard_errors({effect})), 4) << effect;
}

TEST(SlowDrift, AsksForEnoughSegmentsAndForARate) {
  EXPECT_FALSE(rate_apart(runs_with({}, 4), kPositionChannel, kVelocityChannel));
  EXPECT_FALSE(rate_apart(runs_with({}, 1), kPositionChannel, servo().channel("spool_position")));
  std::vector<SegmentedRun> runs = runs_with({}, 1);
  for (SegmentedRun& run : runs)
    for (const std::size_t first : run.restarts)
      run.recording.values[(first + 5) * run.recording.columns() + static_cast<std::size_t>(kVelocityChannel)] =
          std::nan("");
  EXPECT_FALSE(rate_apart(runs, kPositionChannel, kVelocityChannel));
}

TEST(JoinedSegments, AreLongerAndStopAtABreak) {
  Recording recording = simulate(servo(), servo_setup("multisine", 3), 5);
  const double gap = 10;
  for (std::size_t k = 2300; k < recording.rows(); ++k) recording.time[k] += gap;
  const SegmentedRun run = cut_run(servo(), "run", std::move(recording), 0.5);
  ASSERT_EQ(run.segments(), 9u);  // four before the break, five after it
  const SegmentedRun joined = joined_segments(run, 3);
  ASSERT_EQ(joined.segments(), 2u);
  EXPECT_EQ(joined.segment, 3 * run.segment);
  EXPECT_EQ(joined.restarts[0], run.restarts[0]);
  EXPECT_EQ(joined.restarts[1], run.restarts[4]);
  EXPECT_DOUBLE_EQ(joined.counted[1], run.counted[4] + run.counted[5] + run.counted[6]);
}

// The whole diagnosis: told with its size where the usual segments say nothing, and silence where there is none.
TEST(SlowDrift, IsToldByTheDiagnosis) {
  GapSettings settings;
  settings.jobs = 2;
  for (const Port& port : servo().ports)
    for (const FittingEffect& fitting : port.effects)
      if (port.name != "sensor.position" && port.name != "flow.chamber_a_chamber_b")
        settings.without.push_back(fitting.effect + "@" + port.name);
  const auto diagnose = [&](const std::vector<std::string>& effects) {
    return diagnose_gap(servo(), runs_with(effects, 0.25), {}, settings, {});
  };
  const GapResult drifting = diagnose({"drift@sensor.position:rate=2e-4"});
  EXPECT_EQ(drifting.verdict, "named");
  ASSERT_EQ(drifting.effects.size(), 1u);
  EXPECT_EQ(drifting.effects.front().effect, "drift");
  EXPECT_NEAR(drifting.effects.front().parameters.at("rate"), 2e-4, 3e-5);
  EXPECT_EQ(drifting.runs.size(), 2u);
  ASSERT_FALSE(drifting.remarks.empty());
  EXPECT_NE(drifting.remarks.back().find("over segments of 1 s, 4 times as long as usual"), std::string::npos);
  EXPECT_TRUE(diagnose({}).effects.empty());
  // Beside what is told it is a remark.
  const GapResult leak =
      diagnose({"drift@sensor.position:rate=2e-4", "orifice_leakage@flow.chamber_a_chamber_b:coefficient=2e-8"});
  EXPECT_EQ(leak.verdict, "named");
  EXPECT_NE(fmt::format("{}", fmt::join(leak.remarks, "; ")).find("its transducer drifts"), std::string::npos);
  settings.without.push_back("drift@sensor.position");
  EXPECT_TRUE(diagnose({"drift@sensor.position:rate=2e-4"}).effects.empty());
}

}  // namespace
}  // namespace faultline
