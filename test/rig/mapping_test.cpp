#include "faultline/rig/mapping.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

Datasheet sheet() {
  Datasheet sheet;
  sheet.rig = "toy";
  sheet.sample_period = 0.01;
  const auto add = [&](const char* name, const char* unit, Role role, bool truth = false) {
    Channel channel;
    channel.name = name;
    channel.unit = unit;
    channel.role = role;
    channel.ground_truth = truth;
    sheet.channels.push_back(channel);
  };
  add("reference", "m", Role::setpoint);
  add("voltage", "V", Role::command);
  add("stroke", "m", Role::output);
  add("pressure", "Pa", Role::input);
  add("true_leak", "m^3/s", Role::output, true);
  return sheet;
}

class MappingFile : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name = (std::filesystem::temp_directory_path() / "faultline_mapping_XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  Mapping read(const std::string& text, double resample = std::numeric_limits<double>::quiet_NaN()) {
    const std::string file = folder_ + "/map.yaml";
    std::ofstream(file) << text;
    return read_mapping(file, sheet_, resample);
  }
  std::string complaint(const std::string& text) {
    try {
      read(text);
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  }

  std::string folder_;
  const Datasheet sheet_ = sheet();
};

const std::string kChannels = "channels:\n  voltage: /cmd/data\n  stroke: /s/position[1]\n  pressure: /p/data\n";

TEST_F(MappingFile, ValuesAreScaledThenConverted) {
  const Mapping mapping = read(
      "channels:\n  voltage: {from: u, hold: .inf}\n  stroke: {from: x, unit: mm, sign: -1, scale: 2, offset: 5}\n"
      "  pressure: {from: p, unit: bar}\n");
  ASSERT_EQ(mapping.channels.size(), 3u);
  const Conversion stroke = mapping.channels[1].conversion(sheet_.channels[2], "mm");
  EXPECT_DOUBLE_EQ(stroke(10), -0.025);
  EXPECT_DOUBLE_EQ(mapping.channels[2].conversion(sheet_.channels[3], "bar")(3), 3e5);
  const AssemblyPlan plan = assembly_plan(mapping, sheet_, 1);
  EXPECT_TRUE(plan.signals[0].held);
  EXPECT_TRUE(std::isinf(plan.signals[0].hold));
  EXPECT_FALSE(plan.signals[1].held);
  EXPECT_EQ(plan.leader, 1u);
  EXPECT_EQ(unmapped(mapping, sheet_), (std::vector<std::string>{"reference", "true_leak"}));
  std::vector<double> values(5, 9);
  arrange_row(mapping, {1, 2, 3}, values);
  EXPECT_EQ(values, (std::vector<double>{0, 1, 2, 3, 0}));
}

TEST_F(MappingFile, ResamplingIsToTheRigsPeriodOrAnother) {
  EXPECT_FALSE(read(kChannels).resample);
  EXPECT_EQ(read(kChannels).period, 0.01);
  EXPECT_TRUE(read(kChannels + "resample: true\n").resample);
  EXPECT_EQ(read(kChannels + "resample: true\n").period, 0.01);
  EXPECT_EQ(read(kChannels + "resample: 0.05\n").period, 0.05);
  EXPECT_EQ(read(kChannels, 0.02).period, 0.02);
  EXPECT_EQ(read(kChannels + "resample: 0.05\n", 0).period, 0.01);
}

TEST_F(MappingFile, TimeAndTable) {
  EXPECT_EQ(read(kChannels + "time: receipt\n").clock, "receipt");
  EXPECT_EQ(read(kChannels + "time: Zeit\n").time_column, "Zeit");
  EXPECT_DOUBLE_EQ(read(kChannels + "time: {period: 4, unit: ms}\n").constant_period, 0.004);
  const Mapping mapping = read(kChannels +
                               "time: {column: Zeit, format: \"%H:%M:%S\"}\n"
                               "csv: {separator: tab, decimal: \",\", comment: \"%\", names_line: 3, data_line: 5}\n");
  EXPECT_EQ(mapping.time_format, "%H:%M:%S");
  EXPECT_EQ(mapping.table.separator, '\t');
  EXPECT_EQ(mapping.table.decimal, ',');
  EXPECT_EQ(mapping.table.names_line, 3);
  EXPECT_EQ(mapping.table.data_line, 5);
}

TEST_F(MappingFile, MistakesAreToldInOneLine) {
  struct Case {
    std::string text;
    const char* says;
  };
  const std::string two = "channels:\n  voltage: /cmd/data\n  stroke: ";
  const Case cases[] = {
      {"", "the file is empty; a mapping starts with 'channels:'"},
      {"chanels: {}\n", "key 'chanels' in the mapping is not known"},
      {kChannels + "rate: 3\n", "key 'rate' in the mapping is not known"},
      {"channels:\n  voltage: /a/b\n  stroke: /c/d\n", "lacks channels that toy needs: pressure"},
      {kChannels + "  presure: /x/y\n", "did you mean 'pressure'?"},
      {kChannels + "  stroke: /x/y\n", "is given twice"},
      {two + "/p/x\n  pressure: /p/x\n", "comes from '/p/x', and so does 'stroke'"},
      {two + "{from: x, units: mm}\n  pressure: p\n", "key 'units'"},
      {two + "{unit: mm}\n  pressure: p\n", "lacks the key 'from'"},
      {two + "{from: x, unit: bar}\n  pressure: p\n", "'bar' cannot be converted to 'm'"},
      {two + "{from: x, unit: ell}\n  pressure: p\n", "'ell' is not known"},
      {two + "{from: x, scale: 0}\n  pressure: p\n", "is 0"},
      {two + "{from: x, sign: 2}\n  pressure: p\n", "must be 1 or -1"},
      {two + "{from: x, scale: fast}\n  pressure: p\n", "must be a number"},
      {two + "{from: x, hold: 3}\n  pressure: p\n", "'stroke' is measured"},
      {kChannels + "resample: often\n", "must be true or false"},
      {kChannels + "resample: -1\n", "out of range"},
      {kChannels + "time: {unit: s}\n", "'column' and 'period'"},
      {kChannels + "time: {period: 4, unit: bar}\n", "is no unit of time"},
      {kChannels + "time: {column: t, unit: s, format: \"%H\"}\n", "remove one of them"},
      {kChannels + "csv: {separator: semicolon}\n", "one character"},
      {kChannels + "csv: {decimal: \"x\"}\n", "must be . or ,"},
      {kChannels + "csv: {names_line: 4, data_line: 3}\n", "below names_line"},
      {"channels: [1, 2]\n", "must be a mapping"},
  };
  for (const Case& c : cases) {
    const std::string text = complaint(c.text);
    EXPECT_NE(text.find(c.says), std::string::npos) << c.text << ": " << text;
    EXPECT_NE(text.find("map.yaml"), std::string::npos) << text;
    EXPECT_EQ(text.find('\n'), std::string::npos) << text;
  }
}

TEST_F(MappingFile, TopicsNeedTopics) {
  check_topics(read(kChannels));
  EXPECT_THROW(check_topics(read("channels:\n  voltage: u\n  stroke: /s/x\n  pressure: /p/x\n")), InputError);
  EXPECT_THROW(check_topics(read(kChannels + "time: {period: 1}\n")), InputError);
}

}  // namespace
}  // namespace faultline
