// EstimatorStage: what is not fit to be used never reaches a state; duplicates, late samples, gaps, jumps, resets.
#include "faultline/estimators/estimator_stage.h"

#include <gtest/gtest.h>

#include <limits>

#include "count_allocations.h"
#include "faultline/signal/error.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

const Recording& run() {
  static const Recording recording = simulate(servo(), servo_setup("random", 3), 6);
  return recording;
}

class Stage : public ::testing::Test {
 protected:
  bool take(std::size_t row) { return stage_.process(run().sample(row), estimate_); }
  void take(std::size_t from, std::size_t to) {
    for (std::size_t k = from; k < to; ++k) ASSERT_TRUE(take(k)) << k;
  }
  bool finite() const {
    for (const double v : estimate_.state)
      if (!std::isfinite(v)) return false;
    for (const double v : estimate_.covariance)
      if (!std::isfinite(v)) return false;
    return true;
  }
  EstimatorStage stage_{servo(), servo().estimators.front()};
  Estimate estimate_;
};

TEST_F(Stage, FirstSampleStartsIt) {
  ASSERT_TRUE(take(0));
  EXPECT_TRUE(estimate_.restarted);
  EXPECT_EQ(estimate_.observed, 0);
  EXPECT_EQ(estimate_.state.size(), 6u);
  EXPECT_EQ(estimate_.covariance.size(), 36u);
  EXPECT_EQ(estimate_.innovation.size(), 4u);
  EXPECT_EQ(estimate_.quantities.size(), 7u);
  ASSERT_TRUE(take(1));
  EXPECT_FALSE(estimate_.restarted);
  EXPECT_EQ(estimate_.observed, 4);
  EXPECT_EQ(stage_.counts().restarts, 1u);
}

TEST_F(Stage, BadNumbersOnAnyChannelNeverReachAState) {
  const double bad[] = {std::nan(""), kInfinity, -kInfinity, 1e30, -1e30};
  take(0, 500);
  std::size_t row = 500;
  for (std::size_t c = 0; c < servo().channels.size(); ++c)
    for (const double value : bad) {
      Sample sample = run().sample(row++);
      sample.values[c] = value;
      ASSERT_TRUE(stage_.process(sample, estimate_));
      EXPECT_FALSE(estimate_.restarted);
      EXPECT_EQ(estimate_.channel_status[c],
                std::isfinite(value) ? ChannelStatus::out_of_range : ChannelStatus::missing);
      ASSERT_TRUE(finite()) << servo().channels[c].name << " " << value;
      // Close to what the clean run says: at most one sample of one channel is missing.
      EXPECT_LT(std::abs(estimate_.state[0] - run().at(row - 1, column("position"))), 2e-3) << servo().channels[c].name;
      const bool measured = c == column("position") || c == column("velocity") || c == column("load_pressure") ||
                            c == column("spool_position");
      EXPECT_EQ(estimate_.observed, measured ? 3 : 4);
    }
  EXPECT_EQ(stage_.counts().missing, 3 * servo().channels.size());
  EXPECT_EQ(stage_.counts().out_of_range, 2 * servo().channels.size());
}

TEST_F(Stage, EverythingMissingForAWhile) {
  take(0, 1000);
  for (std::size_t k = 1000; k < 1500; ++k) {
    Sample sample = run().sample(k);
    for (double& v : sample.values) v = std::nan("");
    ASSERT_TRUE(stage_.process(sample, estimate_));
    EXPECT_EQ(estimate_.observed, 0);
    EXPECT_EQ(estimate_.normalised_innovation, 0);
    ASSERT_TRUE(finite());
  }
  take(1500, 2500);
  EXPECT_NEAR(estimate_.state[0], run().at(2499, column("position")), 1e-3);
}

TEST_F(Stage, FirstSampleMayBeBad) {
  Sample sample = run().sample(0);
  for (double& v : sample.values) v = std::nan("");
  ASSERT_TRUE(stage_.process(sample, estimate_));
  EXPECT_TRUE(finite());
  take(1, 1000);
  EXPECT_NEAR(estimate_.state[0], run().at(999, column("position")), 1e-3);
}

TEST_F(Stage, DuplicatesAndLateSamplesAreNotUsed) {
  take(0, 300);
  const Estimate before = estimate_;
  EXPECT_FALSE(take(299));  // the same again, dt = 0
  EXPECT_FALSE(take(250));  // 49 ms late
  EXPECT_EQ(estimate_.state, before.state);
  EXPECT_EQ(estimate_.time, before.time);
  EXPECT_EQ(stage_.counts().stale, 2u);
  EXPECT_EQ(stage_.counts().used, 300u);
  // What follows is as if they had never come.
  EstimatorStage other(servo(), servo().estimators.front());
  Estimate expected;
  for (std::size_t k = 0; k < 320; ++k) other.process(run().sample(k), expected);
  take(300, 320);
  EXPECT_EQ(estimate_.state, expected.state);
  EXPECT_EQ(estimate_.covariance, expected.covariance);
}

TEST_F(Stage, TimeThatIsNoNumberIsNotUsed) {
  take(0, 10);
  for (const double time : {std::nan(""), kInfinity, -kInfinity}) {
    Sample sample = run().sample(10);
    sample.time = time;
    EXPECT_FALSE(stage_.process(sample, estimate_));
  }
  EXPECT_EQ(stage_.counts().stale, 3u);
  take(10, 20);
  EXPECT_TRUE(finite());
  EXPECT_EQ(stage_.counts().restarts, 1u);
}

TEST_F(Stage, LostSamplesAreBridged) {
  take(0, 2000);
  ASSERT_TRUE(take(2030));
  EXPECT_FALSE(estimate_.restarted);
  EXPECT_NEAR(estimate_.state[0], run().at(2030, column("position")), 2e-3);
  // Uncertainty grew meanwhile: the innovation is expected to be larger than from one sample to the next.
  const double bridged = estimate_.innovation_std[0];
  take(2031, 2032);
  EXPECT_GT(bridged, 1.5 * estimate_.innovation_std[0]);
}

TEST_F(Stage, LongGapBeginsAnew) {
  take(0, 2000);
  ASSERT_TRUE(take(2101));  // 0.102 s after the last
  EXPECT_TRUE(estimate_.restarted);
  EXPECT_EQ(stage_.counts().restarts, 2u);
}

TEST_F(Stage, BackwardJumpBeginsAnewAsAFreshOne) {
  take(0, 3000);
  ASSERT_TRUE(take(0));
  EXPECT_TRUE(estimate_.restarted);
  take(1, 500);
  EstimatorStage fresh(servo(), servo().estimators.front());
  Estimate expected;
  for (std::size_t k = 0; k < 500; ++k) fresh.process(run().sample(k), expected);
  EXPECT_EQ(estimate_.state, expected.state);
  EXPECT_EQ(estimate_.covariance, expected.covariance);
}

TEST_F(Stage, ResetIsComplete) {
  take(0, 700);
  stage_.reset();
  Sample sample = run().sample(0);
  sample.values[column("valve_command")] = std::nan("");  // nothing of the run before may be held for it
  EstimatorStage fresh(servo(), servo().estimators.front());
  Estimate expected;
  stage_.process(sample, estimate_);
  fresh.process(sample, expected);
  for (std::size_t k = 1; k < 300; ++k) {
    take(k);
    fresh.process(run().sample(k), expected);
  }
  EXPECT_EQ(estimate_.state, expected.state);
  EXPECT_EQ(estimate_.covariance, expected.covariance);
  EXPECT_TRUE(finite());
}

TEST_F(Stage, WrongNumberOfValuesIsRefused) {
  Sample sample = run().sample(0);
  sample.values.pop_back();
  EXPECT_THROW(stage_.process(sample, estimate_), InputError);
  sample.values.resize(40);
  EXPECT_THROW(stage_.process(sample, estimate_), InputError);
  EXPECT_TRUE(take(0));
}

TEST_F(Stage, AllocatesNothingAfterTheFirstSample) {
  std::vector<Sample> samples;
  for (std::size_t k = 0; k < 300; ++k) samples.push_back(run().sample(k));
  stage_.process(samples[0], estimate_);
  const std::uint64_t before = allocations();
  for (std::size_t k = 1; k < 300; ++k) stage_.process(samples[k], estimate_);
  EXPECT_EQ(allocations() - before, 0u);
}

TEST(EstimatorStage, UnknownModelTypeOrSettingIsRefused) {
  StageSpec spec = servo().estimators.front();
  spec.type = "wishful";
  try {
    EstimatorStage(servo(), spec);
    FAIL();
  } catch (const InputError& error) {
    const std::string said = error.what();
    EXPECT_NE(said.find("stages.yaml:"), std::string::npos) << said;
    EXPECT_NE(said.find("there is no estimator type 'wishful'; there are "), std::string::npos) << said;
    for (const char* type : {"divided_difference_2", "recursive_least_squares", "fault_response"})
      EXPECT_NE(said.find(type), std::string::npos) << said;
  }
  spec = servo().estimators.front();
  spec.settings.set("surplus", 1);
  EXPECT_THROW(EstimatorStage(servo(), spec), InputError);
}

TEST(EstimatorTypes, SayTheirFamilyAndWhetherTheySpeakAtEverySample) {
  const auto is = [](const char* name, const char* family, bool occasional) {
    const EstimatorType* type = registry<EstimatorType>().find(name);
    return type && type->family == family && type->occasional == occasional;
  };
  EXPECT_TRUE(is("divided_difference_1", "kalman", false));
  EXPECT_TRUE(is("divided_difference_2", "kalman", false));
  EXPECT_TRUE(is("extended_kalman", "kalman", false));
  EXPECT_TRUE(is("unscented_kalman", "kalman", false));
  EXPECT_TRUE(is("recursive_least_squares", "parameter", false));
  EXPECT_TRUE(is("fault_response", "response", true));
}

}  // namespace
}  // namespace faultline
