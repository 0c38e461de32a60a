// Two rigs of one kind side by side: what one suffers is not told of the other, and nothing of either lies outside its
// namespace.
#include <set>
#include <string>
#include <utility>

#include <gtest/gtest.h>
#include <ros/package.h>

#include "faultline/rig/simulator.h"
#include "nodes/played_rig.h"

namespace faultline {
namespace {

constexpr double kStart = 1.7e9;

TEST(Names, TwoOfOneKindAreTwoRigs) {
  const Datasheet sheet = find_datasheet(ros::package::getPath("faultline") + "/config", "servo_actuator");
  ros::NodeHandle node;
  const ros::Publisher clock = node.advertise<rosgraph_msgs::Clock>("/clock", 100);
  PlayedRig first(sheet, "press_1", clock), second(sheet, "hall/press_2", clock);
  ASSERT_TRUE(until([&] { return first.connected() && second.connected(); }, 20));

  SimulationSetup setup;
  setup.seed = 4;
  const Recording healthy = simulate(sheet, setup, 12);
  setup.seed = 3;
  setup.effects.push_back(parse_effect("offset@sensor.load_pressure:value=2e5,from=6"));
  const Recording ill = simulate(sheet, setup, 12);
  ASSERT_EQ(healthy.rows(), ill.rows());
  // By turns, in pieces of 5 s, each judged before the next: with their numbers and stamps in one stream they would be
  // read as restarts.
  for (std::size_t row = 0; row < ill.rows(); ++row) {
    for (const auto& [rig, recording] : {std::pair{&first, &ill}, std::pair{&second, &healthy}}) {
      Sample sample = recording->sample(row);
      sample.time = to_seconds(to_stamp(kStart + sample.time));
      sample.sequence = row;
      rig->send(sample);
      if (row % 5000 == 0 || row + 1 == ill.rows()) {
        ASSERT_TRUE(rig->judged()) << "at row " << row;
      }
    }
  }

  ASSERT_EQ(first.report().alarms.size(), 1u);
  EXPECT_EQ(first.report().alarms[0].port, "sensor.load_pressure");
  EXPECT_TRUE(first.report().alarms[0].active);
  EXPECT_NEAR(first.report().alarms[0].since - kStart, 6, 1.5);
  EXPECT_TRUE(second.report().alarms.empty());
  ASSERT_TRUE(
      until([&] { return first.level("press_1: verdict") == 2 && second.level("hall/press_2: verdict") == 0; }, 3));
  for (const PlayedRig* rig : {&first, &second}) {
    int kalman = 0;
    for (const auto& [name, status] : rig->statuses()) {
      if (name.find("/kalman:") == std::string::npos) continue;
      for (const diagnostic_msgs::KeyValue& value : status.values)
        if (value.key == "restarts") kalman += value.value == "0";
    }
    EXPECT_EQ(kalman, 1);
  }

  ros::master::V_TopicInfo topics;
  ASSERT_TRUE(ros::master::getTopics(topics));
  const std::set<std::string> common{"/clock", "/diagnostics", "/rosout", "/rosout_agg"};
  std::set<std::string> own[2];
  for (const ros::master::TopicInfo& topic : topics) {
    if (common.count(topic.name) > 0) continue;
    const bool of_second = topic.name.rfind("/hall/press_2/", 0) == 0;
    const std::string space = of_second ? "/hall/press_2/" : "/press_1/";
    ASSERT_EQ(topic.name.rfind(space, 0), 0u) << topic.name;
    own[of_second].insert(topic.name.substr(space.size()));
  }
  EXPECT_EQ(own[0], own[1]);
  for (const char* name : {"description", "sample", "estimate", "detections", "hypotheses", "alarms"})
    EXPECT_EQ(own[0].count(name), 1u) << name;
  for (const char* service : {"/press_1/kalman/reset", "/hall/press_2/kalman/reset"})
    EXPECT_TRUE(ros::service::exists(service, true));
}

}  // namespace
}  // namespace faultline

int main(int argc, char** argv) {
  ros::init(argc, argv, "names_rostest");
  ::testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
