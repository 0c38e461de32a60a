// Names of LCM channels: of the parameter, and found in logs.
#include "nodes/lcm_name.h"

#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <unistd.h>
#include <lcm/lcm-cpp.hpp>

#include "faultline/signal/error.h"
#include "nodes/conversion_lcm.h"

namespace faultline {
namespace {

std::string taken(const std::string& name) {
  XmlRpc::XmlRpcValue values;
  values["lcm_name"] = name;
  Parameters parameters("/driver", values);
  return read_lcm_name(parameters);
}

TEST(LcmName, HoldsWhatLcmCarries) {
  EXPECT_EQ(taken("hall/press_2"), "hall/press_2");
  EXPECT_EQ(taken(std::string(51, 'a')).size(), 51u);
  for (const std::string& name : {std::string(52, 'a'), std::string("a b"), std::string(".*"), std::string("a\n")})
    EXPECT_THROW(taken(name), InputError) << name;
}

TEST(LcmName, IsReadFromTheChannel) {
  EXPECT_EQ(lcm_channel("small", "sample"), "small.sample");
  EXPECT_EQ(lcm_name_of("hall/a.b.sample", "sample"), "hall/a.b");
  for (const char* channel : {"small.description", ".sample", "sample", "small.samples", ""})
    EXPECT_EQ(lcm_name_of(channel, "sample"), "") << channel;
}

// A log of samples under these names; each says of which rig it is, unless that is empty.
using Senders = std::vector<std::pair<std::string, std::string>>;

class Log {
 public:
  explicit Log(const Senders& senders)
      : path_(std::filesystem::temp_directory_path() / ("lcm_name_" + std::to_string(::getpid()) + ".lcm")) {
    lcm::LogFile file(path_, "w");
    std::int64_t arrival = 1000000;
    for (int second = 0; second < 3; ++second)
      for (const auto& [name, rig] : senders) {
        faultline_lcm::rig_description_t description;
        description.rig = rig;
        description.sample_period = 1;
        description.count = 0;
        if (!rig.empty()) write(file, name + ".description", description, arrival += 1000);
        faultline_lcm::sample_t sample;
        sample.timestamp_us = sample.sequence = sample.count = 0;
        write(file, name + ".sample", sample, arrival += 500000);
      }
  }
  ~Log() { std::filesystem::remove(path_); }

  std::string find(const std::string& wanted) const {
    try {
      return find_lcm_name(path_, "press", wanted);
    } catch (const InputError& error) {
      return error.what();
    }
  }

 private:
  template <typename Message>
  static void write(lcm::LogFile& file, const std::string& channel, const Message& message, std::int64_t arrival) {
    std::vector<unsigned char> bytes(256);
    const int size = message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    lcm::LogEvent event;
    event.eventnum = 0;
    event.timestamp = arrival;
    event.channel = channel;
    event.datalen = size;
    event.data = bytes.data();
    file.writeEvent(&event);
  }

  std::string path_;
};

TEST(LcmName, IsFoundInALog) {
  EXPECT_EQ(Log(Senders{{"press_1", "press"}}).find(""), "press_1");
  EXPECT_EQ(Log(Senders{{"press_1", ""}}).find(""), "press_1");
  EXPECT_EQ(Log(Senders{{"cooling", "cooling_circuit"}, {"press_1", "press"}}).find(""), "press_1");
  EXPECT_EQ(Log(Senders{{"press_1", "press"}, {"press_2", "press"}}).find("press_2"), "press_2");
  // Its description says what does not fit.
  EXPECT_EQ(Log(Senders{{"cooling", "cooling_circuit"}}).find(""), "cooling");
}

TEST(LcmName, ThatIsNotClearIsAskedForInOneLine) {
  const Log log(Senders{{"press_1", "press"}, {"press_2", "press"}});
  EXPECT_NE(log.find("").find("it holds the samples of press_1, press_2: give one as lcm_name"), std::string::npos);
  EXPECT_NE(log.find("press").find("no LCM channel 'press.sample' in it; it holds the samples of press_1, press_2"),
            std::string::npos);
  EXPECT_NE(Log(Senders{{"a", "x"}, {"b", "y"}}).find("").find("no sample of the rig 'press' in it, but of a, b"),
            std::string::npos);
}

}  // namespace
}  // namespace faultline
