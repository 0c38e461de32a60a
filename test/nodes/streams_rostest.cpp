// What a source of samples does wrong is told by its name on /diagnostics, and no longer once it is over.
#include <chrono>
#include <functional>
#include <string>
#include <thread>

#include <gtest/gtest.h>
#include <ros/package.h>

#include "nodes/played_rig.h"

namespace faultline {
namespace {

constexpr double kStart = 1.7e9;

class Streams : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(until([this] { return rig_.connected(); }, 20));
    for (const Channel& channel : sheet_.channels) values_.push_back((channel.minimum + channel.maximum) / 2);
  }

  // Sends what `spoil` makes of good samples, in real time, until the kalman node says something on /diagnostics.
  bool send_until(const std::function<void(Sample&)>& spoil, const std::function<bool(int, const std::string&)>& said) {
    const auto told = [&] {
      for (const auto& [name, status] : rig_.statuses())
        if (name.rfind("servo_actuator/kalman:", 0) == 0) {
          told_ = status.message;
          if (said(status.level, status.message)) return true;
        }
      return false;
    };
    for (const double end = steady_seconds() + 10; steady_seconds() < end;) {
      for (int i = 0; i < 10; ++i, ++number_) {
        Sample sample;
        sample.sequence = number_;
        sample.time = to_seconds(to_stamp(kStart + 1e-3 * static_cast<double>(number_)));
        sample.values = values_;
        if (spoil) spoil(sample);
        rig_.send(sample);
      }
      if (until(told, 0.01)) return true;
    }
    return false;
  }
  bool well() {
    return send_until({},
                      [](int level, const std::string& message) { return level == 0 && message == "samples arrive"; });
  }

  Datasheet sheet_ = find_datasheet(ros::package::getPath("faultline") + "/config", "servo_actuator");
  ros::NodeHandle node_;
  ros::Publisher clock_ = node_.advertise<rosgraph_msgs::Clock>("/clock", 100);
  PlayedRig rig_{sheet_, "servo_actuator", clock_};
  std::vector<double> values_;
  std::uint64_t number_ = 0;
  std::string told_;
};

TEST_F(Streams, EachTroubleIsNamedUntilItIsOver) {
  ASSERT_TRUE(well()) << told_;
  const struct {
    const char* words;
    std::function<void(Sample&)> spoil;
  } kinds[] = {
      {"stamps are 0", [](Sample& sample) { sample.time = 0; }},
      {"samples come every 0.01 s", [](Sample& s) { s.time = kStart + 0.01 * static_cast<double>(s.sequence); }},
      {"do not count (all are 7)", [](Sample& sample) { sample.sequence = 7; }},
      {"a sample has 11 values", [](Sample& sample) { sample.values.pop_back(); }},
  };
  for (const auto& kind : kinds) {
    EXPECT_TRUE(send_until(kind.spoil,
                           [&](int level, const std::string& message) {
                             return level > 0 && message.find(kind.words) != std::string::npos;
                           }))
        << kind.words << ": " << told_;
    EXPECT_TRUE(well()) << "after " << kind.words << ": " << told_;
  }
}

}  // namespace
}  // namespace faultline

int main(int argc, char** argv) {
  ros::init(argc, argv, "streams_rostest");
  ::testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
