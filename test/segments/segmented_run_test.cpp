// Recordings in segments: their noise, what is smoothed, what is left out and what that is called.
#include "faultline/segments/segmented_run.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "faultline/numerics/random.h"
#include "faultline/segments/smoothing.h"
#include "faultline/signal/error.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

constexpr double kSegment = 0.5;  // s

void smooth(Recording& recording) {
  std::vector<double> noise;
  for (std::size_t c = 0; c < recording.columns(); ++c) noise.push_back(noise_floor(recording, c));
  smooth_inputs(servo(), recording, 0, recording.rows(), 100, noise, {});
}

TEST(NoiseFloor, FindsWhiteNoiseUnderAMovingSignal) {
  Recording recording;
  recording.channels.resize(2);
  for (Channel& channel : recording.channels) channel.minimum = -1, channel.maximum = 1;
  Random random(5);
  for (int k = 0; k < 20000; ++k) {
    Sample sample;
    sample.time = 1e-3 * k;
    const double moving = 0.3 * std::sin(2 * 3.14159265358979 * 2 * sample.time);
    sample.values = {moving + 0.01 * random.normal(), moving};
    recording.append(sample);
  }
  EXPECT_NEAR(noise_floor(recording, 0), 0.01, 0.0004);
  EXPECT_LT(noise_floor(recording, 1), 1e-6);
}

TEST(NoiseFloor, OfASimulatedRunIsWhatTheDatasheetSays) {
  const Recording run = simulate(servo(), servo_setup("multisine"), 10);
  for (const char* channel : {"velocity", "load_pressure", "chamber_a_pressure"}) {
    const double says = servo().channels[column(channel)].noise_std;
    EXPECT_NEAR(noise_floor(run, column(channel)), says, 0.08 * says) << channel;
  }
}

TEST(ShorterSegments, CutEachAndKeepWhatItCounts) {
  SimulationSetup setup = servo_setup("multisine");
  Recording recording = simulate(servo(), setup, 2.6);
  for (std::size_t k = 700; k < 900; ++k)
    recording.values[k * recording.columns() + column("velocity")] = std::numeric_limits<double>::quiet_NaN();
  const SegmentedRun run = cut_run(servo(), "a.bag", std::move(recording), kSegment);
  const SegmentedRun shorter = shorter_segments(servo(), run, 3);  // 166 rows; the last two of each are left out
  ASSERT_EQ(run.segments(), 5u);
  ASSERT_EQ(shorter.segments(), 15u);
  EXPECT_EQ(shorter.segment, 166u);
  EXPECT_EQ(shorter.restarts[4], 500u + 166u);
  const double outputs = static_cast<double>(compared_outputs(servo()).size());
  EXPECT_EQ(shorter.counted[0], 166 * outputs);
  EXPECT_EQ(shorter.counted[4], 166 * outputs - (832 - 700));
  EXPECT_TRUE(shorter.starts.empty());
}

TEST(CutRun, HidesGroundTruthAndCutsSegments) {
  SimulationSetup setup = servo_setup("multisine");
  open_bypass(setup, 0.5, 3);
  Recording recording = simulate(servo(), setup, 2);
  ASSERT_GT(recording.at(1500, column("leak_valve_command")), 2.9);
  // A number that is missing where nobody looks does no harm.
  recording.values[100 * recording.columns() + column("leak_flow")] = std::numeric_limits<double>::quiet_NaN();
  const SegmentedRun run = cut_run(servo(), "a.bag", std::move(recording), kSegment);
  EXPECT_EQ(run.recording.at(1500, column("leak_valve_command")), 0);
  EXPECT_EQ(run.recording.at(100, column("leak_flow")), 0);
  EXPECT_EQ(run.segments(), 4u);
  EXPECT_EQ(run.restarts[3], 1500u);
}

TEST(SmoothInputs, TakesNoiseAwayAndLeavesTheSignal) {
  Recording recording = simulate(servo(), servo_setup("multisine"), 4);
  const std::size_t supply = column("supply_pressure");
  Random random(3);
  std::vector<double> truth;
  for (std::size_t k = 0; k < recording.rows(); ++k) {
    const double value = 6.9e6 + 2e5 * std::sin(2 * 3.14159265358979 * 5 * recording.time[k]);
    truth.push_back(value);
    recording.values[k * recording.columns() + supply] = value + 1e4 * random.normal();
  }
  const std::vector<double> position_before = {recording.at(700, column("position"))};
  smooth(recording);
  double square = 0;
  for (std::size_t k = 20; k + 20 < recording.rows(); ++k) square += std::pow(recording.at(k, supply) - truth[k], 2);
  EXPECT_LT(std::sqrt(square / static_cast<double>(recording.rows() - 40)), 0.45e4);
  EXPECT_EQ(recording.at(700, column("position")), position_before.front());  // outputs are not touched
}

TEST(SmoothInputs, LeavesWhatMovesTooFast) {
  Recording recording = simulate(servo(), servo_setup("multisine"), 4);
  const std::size_t supply = column("supply_pressure");
  for (std::size_t k = 0; k < recording.rows(); ++k)
    recording.values[k * recording.columns() + supply] = k / 40 % 2 ? 6e6 : 7e6;  // steps, without noise
  const Recording before = recording;
  smooth(recording);
  for (std::size_t k = 0; k < recording.rows(); ++k) ASSERT_EQ(recording.at(k, supply), before.at(k, supply)) << k;
}

TEST(CutRun, EndsSegmentsAtGapsAndAtMissingCommands) {
  const Recording good = simulate(servo(), servo_setup("multisine"), 4);
  const SegmentedRun whole = cut_run(servo(), "a.bag", good, kSegment);
  EXPECT_EQ(whole.segments(), 8u);
  EXPECT_EQ(whole.remark, "");

  Recording late = good;
  for (std::size_t k = 700; k < late.rows(); ++k) late.time[k] += 0.004;
  const SegmentedRun gap = cut_run(servo(), "a.bag", late, kSegment);
  ASSERT_EQ(gap.stretches.size(), 2u);
  EXPECT_EQ(gap.stretches[1].first, 700u);
  ASSERT_EQ(gap.segments(), 7u);
  EXPECT_EQ(gap.restarts[1], 700u);
  EXPECT_NE(gap.remark.find("0.005 s between the samples at 0.704 s"), std::string::npos) << gap.remark;

  Recording lost = good;
  lost.values[1200 * lost.columns() + column("valve_command")] = std::numeric_limits<double>::quiet_NaN();
  const SegmentedRun cut = cut_run(servo(), "a.bag", lost, kSegment);
  ASSERT_EQ(cut.stretches.size(), 2u);
  EXPECT_EQ(cut.stretches[1].first, 1201u);
  EXPECT_NE(cut.remark.find("valve_command"), std::string::npos) << cut.remark;

  lost.values[1200 * lost.columns() + column("valve_command")] = 50;  // no such command is possible
  EXPECT_EQ(cut_run(servo(), "a.bag", lost, kSegment).stretches.size(), 2u);
  for (std::size_t k = 0; k < lost.rows(); ++k)
    lost.values[k * lost.columns() + column("supply_pressure")] = std::nan("");
  try {
    cut_run(servo(), "a.bag", lost, kSegment);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("supply_pressure is missing"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("record it"), std::string::npos) << error.what();
  }
}

TEST(CutRun, LeavesReadingsOutThatAreMissingOrBounds) {
  Recording run = simulate(servo(), servo_setup("multisine"), 2);
  const std::size_t velocity = column("velocity"), position = column("position");
  for (std::size_t k = 520; k < 620; ++k) run.values[k * run.columns() + velocity] = std::nan("");
  for (std::size_t k = 1000; k < 1040; ++k)
    run.values[k * run.columns() + position] = servo().channels[position].maximum;
  const SegmentedRun cut = cut_run(servo(), "a.bag", run, kSegment);
  ASSERT_EQ(cut.segments(), 4u);
  EXPECT_EQ(cut.counted[0], 3000);
  EXPECT_EQ(cut.counted[1], 2900);
  EXPECT_EQ(cut.counted[2], 2960);
  EXPECT_NE(cut.remark.find("100 readings are missing"), std::string::npos) << cut.remark;
  EXPECT_NE(cut.remark.find("40 readings at an end"), std::string::npos) << cut.remark;
  EXPECT_NE(cut.remark.find("(velocity 100)"), std::string::npos) << cut.remark;
  EXPECT_NE(cut.remark.find("(position 40)"), std::string::npos) << cut.remark;
  // Neither is noise.
  const double says = servo().channels[velocity].noise_std;
  EXPECT_NEAR(noise_floor(cut.recording, velocity), says, 0.1 * says);
}

// A wire that is off for a moment: what no transducer of that range shows is no bound.
TEST(CutRun, AReadingFarBeyondItsRangeIsMissing) {
  Recording run = simulate(servo(), servo_setup("multisine"), 2);
  const std::size_t position = column("position");
  const double highest = servo().channels[position].maximum;
  for (const auto& [row, value] : {std::pair(500, 4 * highest), {700, -1e300}, {900, 1.001 * highest}})
    run.values[static_cast<std::size_t>(row) * run.columns() + position] = value;
  const SegmentedRun cut = cut_run(servo(), "a.bag", run, kSegment);
  EXPECT_NE(cut.remark.find("2 readings are missing (position 2)"), std::string::npos) << cut.remark;
  EXPECT_NE(cut.remark.find("1 readings at an end of their range count as bounds (position 1)"), std::string::npos)
      << cut.remark;
  EXPECT_TRUE(std::isnan(cut.recording.at(500, position)));
}

TEST(CutRun, TakesThePeriodOfTheRun) {
  Recording run = simulate(servo(), servo_setup("multisine"), 4), slow;
  slow.rig = run.rig;
  slow.channels = run.channels;
  for (std::size_t k = 0; k < run.rows(); k += 2) slow.append(run.sample(k));
  const SegmentedRun cut = cut_run(servo(), "a.bag", slow, kSegment);
  EXPECT_NEAR(cut.period, 0.002, 1e-12);
  EXPECT_EQ(cut.segment, 250u);
  EXPECT_EQ(cut.segments(), 8u);
}

TEST(CutRun, RefusesWhatHoldsNoSegment) {
  try {
    cut_run(servo(), "a.bag", simulate(servo(), servo_setup("multisine"), 0.3), kSegment);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("a.bag: no 0.5 s without a break"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace faultline
