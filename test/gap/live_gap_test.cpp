// The gap while the rig runs: normal on a healthy rig, left when an effect comes, the place, breaks and jumps of time.
#include "faultline/gap/live_gap.h"
#include "faultline/gap/normal_gap.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "faultline/signal/error.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

Recording with_effect(const char* effect, double duration, std::uint64_t seed = 12) {
  SimulationSetup setup = off_nominal("random", seed);
  if (*effect) setup.effects.push_back(parse_effect(effect));
  return simulate(servo(), setup, duration);
}

// Every state that came, in order.
std::vector<LiveGapState> play(LiveGap& gap, const Recording& run, double shift = 0, std::size_t last = 1000000) {
  std::vector<LiveGapState> states;
  for (std::size_t k = 0; k < std::min(run.rows(), last); ++k) {
    Sample sample = run.sample(k);
    sample.time += shift;
    if (gap.process(sample)) states.push_back(gap.state());
  }
  return states;
}

TEST(LiveGap, ANominalRigLeavesOnlyNoise) {
  LiveGap gap(servo(), {});
  const std::vector<LiveGapState> states = play(gap, simulate(servo(), servo_setup("random", 4), 8));
  ASSERT_EQ(states.size(), 15u);  // the first of 16 segments gives the second its past
  for (const LiveChannelGap& channel : states.back().channels) {
    EXPECT_LT(channel.smoothed, 0.25) << channel.channel;
    const double says = servo().channels[column(channel.channel)].noise_std;
    EXPECT_NEAR(channel.rms, says, 0.25 * says) << channel.channel;
    EXPECT_FALSE(channel.left);
  }
  EXPECT_FALSE(states.back().left);
}

TEST(LiveGap, TheDatasheetSaysWhatIsNormalOfEveryOutput) {
  for (const Channel& channel : servo().channels)
    EXPECT_EQ(servo().normal_gap.count(channel.name), channel.role == Role::output && !channel.ground_truth ? 1u : 0u)
        << channel.name;
}

TEST(LiveGap, AHealthyRigWithinItsTolerancesIsNormal) {
  for (const char* profile : {"square", "random", "steps"}) {
    LiveGap gap(servo(), {});
    for (const LiveGapState& state : play(gap, simulate(servo(), off_nominal(profile, 202), 16)))
      EXPECT_FALSE(state.left) << profile << " at " << state.time << " s: " << state.text;
    EXPECT_EQ(gap.counts().located, 0u);
  }
}

TEST(LiveGap, ADeadbandLeavesNormalAndIsLocated) {
  LiveGap gap(servo(), {});
  const std::vector<LiveGapState> states = play(gap, with_effect("deadband@restriction.valve:width=0.6,from=8", 18));
  const auto out = std::find_if(states.begin(), states.end(), [](const LiveGapState& state) { return state.left; });
  ASSERT_NE(out, states.end());
  EXPECT_GT(out->time, 8);
  EXPECT_LT(out->time, 12);
  const LiveGapState& last = states.back();
  EXPECT_TRUE(last.left);
  EXPECT_DOUBLE_EQ(last.since, out->time);
  EXPECT_GT(last.worst, 1);
  EXPECT_EQ(last.place.port, "restriction.valve") << last.text;
  EXPECT_GT(last.place.share, 0.3);
  EXPECT_LE(last.place.share, 1.0);
  EXPECT_NE(last.text.find("restriction.valve"), std::string::npos) << last.text;
  EXPECT_LE(last.place.inseparable.size(), 2u) << last.text;
  EXPECT_FALSE(last.regions.empty());
  for (std::size_t i = 1; i < last.regions.size(); ++i)
    EXPECT_GE(last.regions[i - 1].enrichment, last.regions[i].enrichment);
}

TEST(LiveGap, AnInternalLeakIsLocated) {
  LiveGap gap(servo(), {});
  const LiveGapState last =
      play(gap, with_effect("orifice_leakage@flow.chamber_a_chamber_b:coefficient=2e-8", 12)).back();
  ASSERT_TRUE(last.left);
  EXPECT_EQ(last.place.port, "flow.chamber_a_chamber_b") << last.text;
  EXPECT_LE(last.place.inseparable.size(), 1u) << last.text;
}

TEST(LiveGap, AJumpOfTimeBeginsAnewWithTheSameAnswers) {
  const Recording run = with_effect("deadband@restriction.valve:width=0.6", 6);
  LiveGap gap(servo(), {});
  const std::vector<LiveGapState> first = play(gap, run, 100);
  const std::vector<LiveGapState> backwards = play(gap, run, 50);
  const std::vector<LiveGapState> forwards = play(gap, run, 200);
  EXPECT_EQ(gap.counts().restarts, 2u);
  ASSERT_EQ(backwards.size(), first.size());
  ASSERT_EQ(forwards.size(), first.size());
  EXPECT_EQ(backwards.front().segments, 1u);
  EXPECT_TRUE(first.back().left);
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_EQ(backwards[i].left, first[i].left);
    EXPECT_EQ(backwards[i].place.port, first[i].place.port);
    for (std::size_t o = 0; o < first[i].channels.size(); ++o)
      EXPECT_NEAR(backwards[i].channels[o].smoothed, first[i].channels[o].smoothed,
                  1e-3 * (1 + first[i].channels[o].smoothed));
  }
}

TEST(LiveGap, MissingAndInvalidSamplesCutTheWindowOnly) {
  const Recording run = simulate(servo(), servo_setup("random", 4), 8);
  LiveGap gap(servo(), {});
  std::size_t states = 0;
  for (std::size_t k = 0; k < run.rows(); ++k) {
    if (k == 1000 || (k >= 2600 && k < 2605)) continue;  // one is lost, five are
    Sample sample = run.sample(k);
    if (k == 4000) sample.values[column("velocity")] = std::nan("");
    if (k == 5200) sample.values[column("valve_command")] = std::nan("");
    states += gap.process(sample);
    if (k == 3000) gap.process(sample);  // twice
  }
  EXPECT_EQ(gap.counts().cuts, 2u);  // the loss of five, the command
  EXPECT_EQ(gap.counts().restarts, 0u);
  EXPECT_EQ(states, 4u + 4u + 4u);
  EXPECT_EQ(gap.state().segments, 10u);  // the means go on over a cut
  EXPECT_FALSE(gap.state().left);
}

TEST(LiveGap, SaysThatNothingIsNormalWhereTheDatasheetIsSilent) {
  Datasheet sheet = servo();
  sheet.normal_gap.clear();
  LiveGap gap(sheet, {});
  const LiveGapState last = play(gap, with_effect("deadband@restriction.valve:width=0.6", 6)).back();
  EXPECT_FALSE(last.left);
  EXPECT_TRUE(std::isnan(last.channels.front().normal));
  EXPECT_GT(last.channels.front().smoothed, 100);
  EXPECT_NE(last.text.find("does not say"), std::string::npos);
}

TEST(NormalGap, IsMadeOfTolerancesAndHoldsOnAnotherRig) {
  Datasheet sheet = servo();
  sheet.normal_gap = simulated_normal_gap(sheet, {}, 2);
  EXPECT_EQ(sheet.normal_gap.size(), servo().normal_gap.size());
  for (const auto& [channel, most] : sheet.normal_gap) {
    EXPECT_GE(most, 1) << channel;
    EXPECT_LT(most, 5 * servo().normal_gap.at(channel)) << channel;  // 90 longer simulations said that
  }
  for (const char* profile : {"random", "steps"}) {
    LiveGap gap(sheet, {});
    for (const LiveGapState& state : play(gap, simulate(servo(), off_nominal(profile, 202), 16)))
      EXPECT_FALSE(state.left) << profile << " at " << state.time << " s: " << state.text;
  }
  LiveGap gap(sheet, {});
  EXPECT_TRUE(play(gap, with_effect("deadband@restriction.valve:width=0.6", 12)).back().left);
}

TEST(NormalGap, TellsItsProgressAndEndsWhenAsked) {
  std::size_t most = 0, told = 0;
  const auto progress = [&](std::size_t done) {
    most = std::max(most, done);
    ++told;
    return done < 2;
  };
  EXPECT_EQ(normal_gap_simulations(servo()), 24u);
  EXPECT_TRUE(simulated_normal_gap(servo(), {}, 1, progress).empty());
  EXPECT_EQ(most, 2u);
  EXPECT_GT(told, 20u);  // also within a simulation
}

TEST(LiveGap, RefusesSettingsThatMakeNoSense) {
  LiveGapSettings settings;
  settings.least_segments = 20;
  EXPECT_THROW(LiveGap(servo(), settings), InputError);
}

}  // namespace
}  // namespace faultline
