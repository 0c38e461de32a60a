// What was once told on /diagnostics ends there with OK: an alarm whose run begins anew, and one that got another name.
#include <set>
#include <string>

#include <gtest/gtest.h>
#include <ros/package.h>

#include "faultline/rig/simulator.h"
#include "nodes/played_rig.h"

namespace faultline {
namespace {

constexpr double kStart = 1.7e9;
constexpr char kOffset[] = "offset@sensor.load_pressure:value=2e5,from=6";

class AlarmClosing : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(until([this] { return rig_.connected(); }, 20));
  }

  Recording record(double duration, const std::string& effect) const {
    SimulationSetup setup;
    setup.seed = 3;
    if (!effect.empty()) setup.effects.push_back(parse_effect(effect));
    return simulate(sheet_, setup, duration);
  }

  // Names of alarms that are open on /diagnostics: "RIG: ..." but for the verdict.
  std::set<std::string> open() const {
    std::set<std::string> names;
    for (const auto& [name, status] : rig_.statuses())
      if (name.rfind("servo_actuator: ", 0) == 0 && name != "servo_actuator: verdict" && status.level > 0)
        names.insert(name);
    return names;
  }

  Datasheet sheet_ = find_datasheet(ros::package::getPath("faultline") + "/config", "servo_actuator");
  ros::NodeHandle node_;
  ros::Publisher clock_ = node_.advertise<rosgraph_msgs::Clock>("/clock", 100);
  PlayedRig rig_{sheet_, "servo_actuator", clock_};
};

TEST_F(AlarmClosing, AnotherNameAndARunThatBeginsAnewCloseIt) {
  // At first no cause is likely enough: the alarm has no name.
  ASSERT_TRUE(rig_.send(record(9, kOffset), kStart));
  ASSERT_TRUE(until([this] { return !open().empty(); }, 3));
  EXPECT_EQ(open(), std::set<std::string>{"servo_actuator: unknown"});

  // It earns one.
  ASSERT_TRUE(rig_.send(record(12, kOffset), kStart - 100));
  const std::string named = "servo_actuator: sensor offset at sensor.load_pressure";
  ASSERT_TRUE(until([&] { return open() == std::set<std::string>{named}; }, 3));
  EXPECT_EQ(rig_.level("servo_actuator: unknown"), 0);
  EXPECT_EQ(rig_.level("servo_actuator: verdict"), 2);

  // The run begins anew, healthy.
  ASSERT_TRUE(rig_.send(record(4, ""), kStart - 200));
  EXPECT_TRUE(rig_.report().alarms.empty()) << rig_.report().verdict;
  EXPECT_TRUE(until([&] { return rig_.level("servo_actuator: verdict") == 0 && rig_.level(named) == 0; }, 3));
  EXPECT_EQ(open(), std::set<std::string>{});
}

}  // namespace
}  // namespace faultline

int main(int argc, char** argv) {
  ros::init(argc, argv, "alarm_closing_rostest");
  ::testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
