// The test is the rig: it sends samples and holds what the nodes say against the same stages run here.
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <ros/package.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>

#include "faultline/alarms/alarm_keeper.h"
#include "faultline/estimators/estimator_stage.h"
#include "faultline/isolation/isolation_stage.h"
#include "faultline/rig/simulator.h"
#include "nodes/assessment_messages.h"
#include "nodes/conversion.h"
#include "nodes/node_main.h"

namespace faultline {
namespace {

constexpr double kStart = 1.7e9;
// Of a message, but for the count that ROS puts into its header.
template <class Message>
std::size_t fingerprint(Message message) {
  message.header.seq = 0;
  std::string bytes(ros::serialization::serializationLength(message), '\0');
  ros::serialization::OStream stream(reinterpret_cast<std::uint8_t*>(bytes.data()),
                                     static_cast<std::uint32_t>(bytes.size()));
  ros::serialization::serialize(stream, message);
  return std::hash<std::string>()(bytes);
}

constexpr double kLeakFrom = 25;  // s: a leak of 1.5e-8 m^3/(s sqrt(Pa))

class Graph : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    sheet_ = new Datasheet(find_datasheet(ros::package::getPath("faultline") + "/config", "servo_actuator"));
  }

  void SetUp() override {
    for (const StageSpec& spec : sheet_->estimators) stages_.emplace_back(*sheet_, spec);
    estimates_here_.resize(stages_.size());
    const ros::TransportHints fast = ros::TransportHints().tcpNoDelay();
    description_ = node_.advertise<faultline_msgs::RigDescription>("/servo_actuator/description", 1, true);
    samples_ = node_.advertise<faultline_msgs::Sample>("/servo_actuator/sample", kQueue);
    description_.publish(to_message(*sheet_, "a test"));
    estimates_ = node_.subscribe<faultline_msgs::Estimate>(
        "/servo_actuator/estimate", 4 * kQueue,
        [this](const faultline_msgs::Estimate::ConstPtr& message) {
          if (message->stage == sheet_->estimators.front().name)
            heard_.push_back(from_message(*message));
          else
            heard_rankings_.push_back(from_message(*message));
        },
        {}, fast);
    detections_ = node_.subscribe<faultline_msgs::Detections>(
        "/servo_actuator/detections", 4 * kQueue,
        [this](const faultline_msgs::Detections::ConstPtr& message) {
          heard_detections_.push_back(fingerprint(*message));
        },
        {}, fast);
    hypotheses_ = node_.subscribe<faultline_msgs::Hypotheses>(
        "/servo_actuator/hypotheses", 4 * kQueue,
        [this](const faultline_msgs::Hypotheses::ConstPtr& message) {
          heard_hypotheses_.push_back(fingerprint(*message));
        },
        {}, fast);
    alarms_ = node_.subscribe<faultline_msgs::AlarmArray>(
        "/servo_actuator/alarms", 1000,
        [this](const faultline_msgs::AlarmArray::ConstPtr& message) { report_ = from_message(*message); }, {}, fast);
    diagnostics_ = node_.subscribe<diagnostic_msgs::DiagnosticArray>(
        "/diagnostics", 1000, [this](const diagnostic_msgs::DiagnosticArray::ConstPtr& message) {
          for (const diagnostic_msgs::DiagnosticStatus& status : message->status)
            if (status.name == "servo_actuator: verdict") {
              level_ = status.level;
              said_ = status.message;
            }
        });
    ASSERT_TRUE(until(
        [this] {
          return samples_.getNumSubscribers() >= 2 && detections_.getNumPublishers() >= 1 &&
                 hypotheses_.getNumPublishers() >= 1 && estimates_.getNumPublishers() >= 1 &&
                 alarms_.getNumPublishers() >= 1 && diagnostics_.getNumPublishers() >= 1;
        },
        15));
    std_srvs::Trigger trigger;
    ASSERT_TRUE(ros::service::waitForService("/servo_actuator/kalman/reset", 10000));
    ASSERT_TRUE(ros::service::call("/servo_actuator/kalman/reset", trigger));
    EXPECT_TRUE(trigger.response.success);
  }

  // Lets ROS work until something holds.
  bool until(const std::function<bool()>& holds, double seconds) {
    const double end = steady_seconds() + seconds;
    while (!holds()) {
      if (steady_seconds() > end || !ros::ok()) return false;
      ros::spinOnce();
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return true;
  }

  Recording record(std::uint64_t seed, double duration, bool leak) {
    SimulationSetup setup;
    setup.seed = seed;
    if (leak) {
      setup.effects.push_back(parse_effect("orifice_leakage@flow.chamber_a_chamber_b:coefficient=1.5e-8,from=" +
                                           std::to_string(static_cast<int>(kLeakFrom))));
    }
    return simulate(*sheet_, setup, duration);
  }

  // Sends with no more than 2000 samples on the way, and runs the same here.
  void run(
      const Recording& recording, double start, std::uint64_t first_sequence,
      const std::function<void(Sample&)>& spoil = [](Sample&) {}) {
    const std::size_t before = heard_.size();
    for (std::size_t row = 0; row < recording.rows(); ++row) {
      Sample sample = recording.sample(row);
      sample.time = to_seconds(to_stamp(start + sample.time));
      sample.sequence = first_sequence + row;
      spoil(sample);
      samples_.publish(to_message(sample, "servo_actuator"));
      bool taken = false;
      for (std::size_t i = 0; i < stages_.size(); ++i) taken = stages_[i].process(sample, estimates_here_[i]);
      if (taken) {
        expected_.push_back(estimates_here_.front());
        for (std::size_t i = 1; i < stages_.size(); ++i)
          if (stages_[i].news()) expected_rankings_.push_back(estimates_here_[i]);
        const Assessment& assessment = isolation_.process(estimates_here_);
        expected_detections_.push_back(fingerprint(detections_of(assessment, "servo_actuator")));
        expected_hypotheses_.push_back(fingerprint(hypotheses_of(assessment, "servo_actuator")));
        keeper_.process(assessment);
      }
      if (row % 500 == 0) {
        ASSERT_TRUE(until([&] { return before + row < heard_.size() + 2000; }, 20)) << "at row " << row;
      }
    }
    ASSERT_TRUE(until([&] { return heard_.size() == expected_.size(); }, 20))
        << heard_.size() << " of " << expected_.size();
    ASSERT_TRUE(until([&] { return report_.time == keeper_.report().time; }, 5));
  }

  void expect_same_estimates() {
    ASSERT_EQ(heard_.size(), expected_.size());
    for (std::size_t i = 0; i < heard_.size(); ++i) {
      ASSERT_EQ(heard_[i].time, expected_[i].time);
      ASSERT_EQ(heard_[i].sequence, expected_[i].sequence);
      ASSERT_EQ(heard_[i].restarted, expected_[i].restarted);
      ASSERT_EQ(heard_[i].state, expected_[i].state);  // bit for bit
      ASSERT_EQ(heard_[i].covariance, expected_[i].covariance);
      ASSERT_EQ(heard_[i].channel_status, expected_[i].channel_status);
    }
  }

  // Of the stage that ranks causes: what it said, and nothing in between.
  void expect_same_rankings() {
    ASSERT_EQ(heard_rankings_.size(), expected_rankings_.size());
    for (std::size_t i = 0; i < heard_rankings_.size(); ++i) {
      ASSERT_EQ(heard_rankings_[i].sequence, expected_rankings_[i].sequence);
      ASSERT_EQ(heard_rankings_[i].restarted, expected_rankings_[i].restarted);
      ASSERT_TRUE(heard_rankings_[i].ranking && expected_rankings_[i].ranking);
      const Ranking &heard = *heard_rankings_[i].ranking, &expected = *expected_rankings_[i].ranking;
      ASSERT_EQ(heard.since, expected.since);  // bit for bit
      ASSERT_EQ(heard.judged_until, expected.judged_until);
      ASSERT_EQ(heard.evidence, expected.evidence);
      ASSERT_EQ(heard.first.size(), expected.first.size());
      for (std::size_t k = 0; k < heard.first.size(); ++k) {
        ASSERT_EQ(heard.first[k].name(), expected.first[k].name());
        ASSERT_EQ(heard.first[k].amplitude, expected.first[k].amplitude);
        ASSERT_EQ(heard.first[k].std, expected.first[k].std);
      }
    }
  }

  // Of detectors and isolators: bit for bit what the same stages say here, of every sample.
  void expect_same_assessments() {
    EXPECT_TRUE(until(
        [this] {
          return heard_detections_.size() >= expected_detections_.size() &&
                 heard_hypotheses_.size() >= expected_hypotheses_.size();
        },
        20));
    EXPECT_TRUE(heard_detections_ == expected_detections_) << heard_detections_.size();
    EXPECT_TRUE(heard_hypotheses_ == expected_hypotheses_) << heard_hypotheses_.size();
  }

  void expect_same_alarms(std::size_t first = 0) {
    const std::vector<Alarm>& expected = keeper_.report().alarms;
    ASSERT_GE(report_.alarms.size(), first + expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i) {
      const Alarm& heard = report_.alarms[first + i];
      EXPECT_EQ(heard.kind, expected[i].kind);
      EXPECT_EQ(heard.effect, expected[i].effect);
      EXPECT_EQ(heard.port, expected[i].port);
      EXPECT_EQ(heard.level, expected[i].level);
      EXPECT_EQ(heard.active, expected[i].active);
      EXPECT_EQ(to_stamp(heard.since), to_stamp(expected[i].since));
      EXPECT_EQ(to_stamp(heard.raised), to_stamp(expected[i].raised));
      EXPECT_EQ(to_stamp(heard.until), to_stamp(expected[i].until));
      EXPECT_EQ(heard.size, expected[i].size);
    }
  }

  static Datasheet* sheet_;
  ros::NodeHandle node_;
  ros::Publisher description_, samples_;
  ros::Subscriber estimates_, detections_, hypotheses_, alarms_, diagnostics_;
  std::vector<Estimate> heard_, expected_;
  std::vector<Estimate> heard_rankings_, expected_rankings_;
  std::vector<std::size_t> heard_detections_, expected_detections_, heard_hypotheses_, expected_hypotheses_;
  AlarmReport report_;
  int level_ = -1;
  std::string said_;
  std::vector<EstimatorStage> stages_;
  std::vector<Estimate> estimates_here_;
  IsolationStage isolation_{*sheet_};
  AlarmKeeper keeper_{*sheet_};
};

Datasheet* Graph::sheet_ = nullptr;

// Every test starts before the last one's time, so that the alarm node begins anew by itself.
TEST_F(Graph, Test1FindsALeakAndSaysTheSameAsTheStagesHere) {
  run(record(3, 60, true), kStart, 0);
  expect_same_estimates();
  expect_same_rankings();
  expect_same_assessments();
  EXPECT_GT(expected_rankings_.size(), 20u);
  EXPECT_FALSE(expected_rankings_.back().ranking->first.empty());
  expect_same_alarms();
  const std::vector<Alarm>& alarms = report_.alarms;
  ASSERT_FALSE(alarms.empty());
  EXPECT_EQ(alarms[0].kind, AlarmKind::fault);
  EXPECT_EQ(alarms[0].effect, "orifice_leakage");
  EXPECT_EQ(alarms[0].port, "flow.chamber_a_chamber_b");
  EXPECT_TRUE(alarms[0].active);
  EXPECT_NEAR(alarms[0].since - kStart, kLeakFrom, 5);
  EXPECT_LT(alarms[0].raised - kStart - kLeakFrom, 10);
  EXPECT_GT(alarms[0].raised - kStart - kLeakFrom, 0);
  ASSERT_TRUE(alarms[0].has_size);
  EXPECT_LT(alarms[0].low, alarms[0].high);
  EXPECT_NE(report_.verdict.find("eak"), std::string::npos);
  EXPECT_TRUE(until([this] { return level_ == diagnostic_msgs::DiagnosticStatus::ERROR; }, 3));
}

TEST_F(Graph, Test2KeepsInvalidNumbersOutOfTheState) {
  const int position = sheet_->channel("position"), pressure = sheet_->channel("load_pressure");
  const double nan = std::numeric_limits<double>::quiet_NaN();
  run(record(4, 6, false), kStart - 100, 0, [&](Sample& sample) {
    if (sample.sequence >= 3000 && sample.sequence < 3050) sample.values[static_cast<std::size_t>(position)] = nan;
    if (sample.sequence >= 3020 && sample.sequence < 3030) sample.values[static_cast<std::size_t>(pressure)] = 1e12;
  });
  expect_same_estimates();
  for (const Estimate& estimate : heard_)
    for (const double value : estimate.state) ASSERT_TRUE(std::isfinite(value));
  EXPECT_EQ(heard_[3010].channel_status[static_cast<std::size_t>(position)], ChannelStatus::missing);
  EXPECT_EQ(heard_[3025].channel_status[static_cast<std::size_t>(pressure)], ChannelStatus::out_of_range);
  EXPECT_EQ(heard_[3025].observed + 2, heard_[2999].observed);
  expect_same_alarms();
  int data = 0;
  for (const Alarm& alarm : report_.alarms) data += alarm.kind == AlarmKind::data;
  EXPECT_EQ(data, 2);
}

TEST_F(Graph, Test3ResetBeginsAnew) {
  const Recording recording = record(5, 1, false);
  run(recording, kStart - 200, 0);
  std_srvs::Trigger trigger;
  ASSERT_TRUE(ros::service::call("/servo_actuator/kalman/reset", trigger));
  for (EstimatorStage& stage : stages_) stage.reset();
  run(recording, kStart - 198.999, 1001);
  expect_same_estimates();
  EXPECT_TRUE(heard_[0].restarted);
  EXPECT_FALSE(heard_[1000].restarted);
  EXPECT_TRUE(heard_[1001].restarted);
}

TEST_F(Graph, Test4ABackwardJumpBeginsAnew) {
  const Recording recording = record(5, 1, false);
  run(recording, kStart - 300, 0);
  const std::size_t length = heard_.size();
  run(recording, kStart - 310, 0);
  expect_same_estimates();
  EXPECT_TRUE(heard_[length].restarted);
  for (std::size_t i = 0; i < length; ++i) ASSERT_EQ(heard_[i].state, heard_[length + i].state);
}

TEST_F(Graph, Test5SilenceIsAnAlarmDatedFromTheLastSample) {
  run(record(6, 1, false), kStart - 400, 0);
  const double last = report_.time;
  ASSERT_TRUE(until([this] { return worst(report_) == AlarmLevel::stale; }, 6));
  const Alarm stale = report_.alarms.back();
  EXPECT_EQ(stale.kind, AlarmKind::data);
  EXPECT_NEAR(stale.since, last + 0.1, 1e-6);
  EXPECT_EQ(stale.raised, stale.since);
  EXPECT_TRUE(until([this] { return level_ == diagnostic_msgs::DiagnosticStatus::STALE; }, 3));

  // Samples that were only on their way take it back ...
  const std::size_t alarms = report_.alarms.size();
  run(record(6, 0.05, false), last + 0.001, 1001);
  ASSERT_TRUE(until([&] { return report_.alarms.size() + 1 == alarms; }, 3));
  // ... and after a true silence it ends with the first of the new ones.
  ASSERT_TRUE(until([this] { return worst(report_) == AlarmLevel::stale; }, 6));
  const double start = last + 5;
  run(record(6, 0.5, false), start, 6000);
  ASSERT_TRUE(until([this] { return !report_.alarms.empty() && !report_.alarms.back().active; }, 3));
  EXPECT_NEAR(report_.alarms.back().until, start, 1e-6);
  expect_same_alarms();
}

TEST_F(Graph, Test6AnEstimatorThatIsBehindIsNoSilence) {
  run(record(6, 1, false), kStart - 500, 0);
  const std::size_t alarms = report_.alarms.size();
  // A sample that the estimator leaves out, as it does not fit: the alarm node hears it, and then nothing.
  Sample late;
  late.time = to_seconds(to_stamp(report_.time + 3));
  late.sequence = 4001;
  late.values.assign(2, 0);
  faultline_msgs::Sample message = to_message(late, "servo_actuator");
  samples_.publish(message);
  ASSERT_TRUE(until([this] { return said_.find("behind the samples") != std::string::npos; }, 8));
  EXPECT_EQ(level_, diagnostic_msgs::DiagnosticStatus::STALE);
  // Well beyond the patience of 2 s and the 0.1 s of a silence.
  until([] { return false; }, 3);
  EXPECT_EQ(report_.alarms.size(), alarms);
  // The next sample is judged: what is told is true again.
  run(record(6, 0.05, false), late.time + 0.001, 4002);
  ASSERT_TRUE(until([this] { return said_.find("behind the samples") == std::string::npos; }, 3));
}

}  // namespace
}  // namespace faultline

int main(int argc, char** argv) {
  ros::init(argc, argv, "graph_rostest");
  ::testing::InitGoogleTest(&argc, argv);
  const ros::NodeHandle alive;
  return RUN_ALL_TESTS();
}
