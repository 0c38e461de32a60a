// EstimateJoin: complete sets, in the order of time, whatever way messages interleave; alarms of several estimators are
// those of the offline program.
#include "faultline/alarms/estimate_join.h"

#include <gtest/gtest.h>

#include "faultline/alarms/diagnosis.h"
#include "faultline/signal/error.h"
#include "rigs/cooling_circuit/recordings.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

Estimate at(std::uint64_t sequence, double mark) {
  Estimate estimate;
  estimate.sequence = sequence;
  estimate.time = 1e-3 * static_cast<double>(sequence);
  estimate.normalised_innovation = mark;
  return estimate;
}

TEST(EstimateJoin, OneEstimatorPassesStraightThrough) {
  EstimateJoin join(1);
  std::vector<Estimate> set;
  for (std::uint64_t k = 0; k < 5; ++k) {
    ASSERT_TRUE(join.add(0, at(k, 1), set));
    EXPECT_EQ(set[0].sequence, k);
  }
  EXPECT_EQ(join.dropped(), 0u);
}

TEST(EstimateJoin, WaitsForAllHoweverFarOneIsAhead) {
  EstimateJoin join(2);
  std::vector<Estimate> set;
  for (std::uint64_t k = 0; k < 500; ++k) ASSERT_FALSE(join.add(1, at(k, 2), set));
  for (std::uint64_t k = 0; k < 500; ++k) {
    ASSERT_TRUE(join.add(0, at(k, 1), set));
    EXPECT_EQ(set[0].sequence, k);
    EXPECT_EQ(set[0].normalised_innovation, 1);
    EXPECT_EQ(set[1].normalised_innovation, 2);
  }
  EXPECT_EQ(join.dropped(), 0u);
}

TEST(EstimateJoin, WhatOneLeftOutIsDroppedAndCounted) {
  EstimateJoin join(2);
  std::vector<Estimate> set;
  join.add(0, at(1, 1), set);
  join.add(0, at(2, 1), set);
  join.add(0, at(3, 1), set);
  ASSERT_TRUE(join.add(1, at(3, 2), set));  // 1 and 2 never come from the other
  EXPECT_EQ(set[0].sequence, 3u);
  EXPECT_EQ(join.dropped(), 2u);
  // A jump back in time: the same numbers once more.
  join.add(1, at(1, 2), set);
  ASSERT_TRUE(join.add(0, at(1, 1), set));
  EXPECT_EQ(set[1].sequence, 1u);
}

TEST(EstimateJoin, AnEstimatorThatNeverSpeaksDoesNotFillTheMemory) {
  EstimateJoin join(2);
  std::vector<Estimate> set;
  for (std::uint64_t k = 0; k < EstimateJoin::kMostWaiting + 50; ++k) ASSERT_FALSE(join.add(0, at(k, 1), set));
  EXPECT_EQ(join.dropped(), 50u);
}

TEST(EstimateJoin, WhatSpeaksNowAndThenIsNotWaitedFor) {
  EstimateJoin join(std::vector<bool>{false, true});
  std::vector<Estimate> set;
  ASSERT_TRUE(join.add(0, at(0, 1), set));
  EXPECT_EQ(set[1].time, Estimate().time);
  EXPECT_FALSE(join.add(1, at(1, 7), set));
  for (std::uint64_t k = 1; k < 5; ++k) {
    ASSERT_TRUE(join.add(0, at(k, 1), set));
    EXPECT_EQ(set[0].sequence, k);
    EXPECT_EQ(set[1].normalised_innovation, 7);
  }
  EXPECT_EQ(join.dropped(), 0u);
}

TEST(EstimateJoin, WhatSpeaksNowAndThenSaysNothingOfSamplesBefore) {
  // One regular stage is ahead of the other by a sample, and with it what speaks now and then in its process.
  EstimateJoin join(std::vector<bool>{false, true, false});
  std::vector<Estimate> set;
  EXPECT_FALSE(join.add(1, at(1, 7), set));
  EXPECT_FALSE(join.add(0, at(1, 1), set));
  EXPECT_FALSE(join.add(1, at(2, 8), set));
  EXPECT_FALSE(join.add(0, at(2, 1), set));
  ASSERT_TRUE(join.add(2, at(1, 2), set));
  EXPECT_EQ(set[1].normalised_innovation, 7);
  ASSERT_TRUE(join.add(2, at(2, 2), set));
  EXPECT_EQ(set[1].normalised_innovation, 8);
}

TEST(EstimateJoin, WhatWasSaidBeforeIsOfThisSample) {
  EstimateJoin join(std::vector<bool>{false, true});
  std::vector<Estimate> set;
  Estimate begun = at(3, 7);
  begun.restarted = true;
  begun.channel_status = {ChannelStatus::good};
  join.add(1, begun, set);
  for (std::uint64_t k = 3; k < 6; ++k) {
    Estimate first = at(k, 1);
    first.channel_status = {ChannelStatus::missing};
    ASSERT_TRUE(join.add(0, first, set));
    EXPECT_EQ(set[1].sequence, k);
    EXPECT_EQ(set[1].time, set[0].time);
    EXPECT_EQ(set[1].restarted, k == 3);
    EXPECT_EQ(set[1].channel_status, set[0].channel_status);
  }
}

TEST(EstimateJoin, TheTypesSayWhoSpeaksNowAndThen) {
  EXPECT_EQ(occasional_stages(cooling()), (std::vector<bool>{false, false}));
  EXPECT_EQ(occasional_stages(servo()), (std::vector<bool>{false, true}));
  Datasheet alone = servo();
  alone.estimators.erase(alone.estimators.begin());
  EXPECT_EQ(occasional_stages(alone), std::vector<bool>{false});  // somebody must tell the time
}

TEST(AlarmStage, NeedsWhatAllEstimatorsSay) {
  AlarmStage stage(cooling());
  EXPECT_THROW(stage.process(Estimate()), InputError);
  EXPECT_THROW(stage.process(std::vector<Estimate>(1)), InputError);
}

// It speaks every 2 s only, but its samples come all the time.
TEST(Diagnosis, AStageThatSpeaksNowAndThenMayBeTheOnlyOne) {
  Datasheet alone = servo();
  alone.estimators.erase(alone.estimators.begin());
  alone.detectors.clear();
  Simulator simulator(alone, servo_setup("random", 5));
  Diagnosis whole(alone);
  for (int k = 0; k < 5000; ++k) ASSERT_TRUE(whole.process(simulator.step()));
  for (const Alarm& alarm : whole.report().alarms) ADD_FAILURE() << alarm.text;
  EXPECT_NEAR(whole.report().time, 4.999, 1e-9);
}

TEST(Diagnosis, InterleavedMessagesGiveTheSameAlarms) {
  Simulator simulator(
      cooling(), cooling_recording("steady", 221, "orifice_leakage@flow.v2_drain_ambient:coefficient=1e-7,from=6"));
  Diagnosis whole(cooling());
  std::vector<EstimatorStage> stages;
  for (const StageSpec& spec : cooling().estimators) stages.emplace_back(cooling(), spec);
  EstimateJoin join(stages.size());
  AlarmStage alarms(cooling());
  std::vector<Estimate> late, set;
  for (int k = 0; k < 7000; ++k) {
    const Sample& sample = simulator.step();
    whole.process(sample);
    Estimate first, second;
    stages[0].process(sample, first);
    stages[1].process(sample, second);
    if (join.add(0, first, set)) alarms.process(set);
    late.push_back(second);
    if (late.size() < 37) continue;  // the second node is 37 samples behind, then catches up
    for (const Estimate& estimate : late)
      if (join.add(1, estimate, set)) alarms.process(set);
    late.clear();
  }
  for (const Estimate& estimate : late)
    if (join.add(1, estimate, set)) alarms.process(set);
  const std::vector<Alarm>&live = alarms.report().alarms, &offline = whole.report().alarms;
  ASSERT_EQ(live.size(), offline.size());
  ASSERT_GE(live.size(), 1u);
  bool leak = false;
  for (std::size_t i = 0; i < live.size(); ++i) {
    EXPECT_EQ(live[i].effect, offline[i].effect);
    EXPECT_EQ(live[i].port, offline[i].port);
    EXPECT_EQ(live[i].raised, offline[i].raised);
    EXPECT_EQ(live[i].until, offline[i].until);
    EXPECT_EQ(live[i].size, offline[i].size);
    leak = leak || (live[i].effect == "orifice_leakage" && live[i].port == "flow.v2_drain_ambient");
  }
  EXPECT_TRUE(leak);
}

}  // namespace
}  // namespace faultline
