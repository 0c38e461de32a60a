#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "faultline/signal/csv.h"
#include "faultline/signal/error.h"
#include "faultline/signal/sample_check.h"

namespace faultline {
namespace {

std::vector<Channel> channels() {
  std::vector<Channel> result(4);
  result[0].name = "reference";
  result[0].unit = "m";
  result[0].role = Role::setpoint;
  result[1].name = "pressure";
  result[1].unit = "Pa";
  result[2].name = "position";
  result[2].unit = "m";
  result[3].name = "leak";
  result[3].unit = "m^3/s";
  result[3].ground_truth = true;
  return result;
}

CsvContent read(const std::string& text) { return read_csv(text, "run.csv", "toy", channels()); }

TEST(Csv, ReadsValuesInTheRigsOrder) {
  const CsvContent content = read("t,position,pressure,leak,reference\n0,0.5,1e5,2e-6,0.25\n0.001,0.625,2e5,0,0.5\n");
  ASSERT_EQ(content.recording.rows(), 2u);
  EXPECT_EQ(content.recording.time[1], 0.001);
  EXPECT_EQ(content.recording.at(0, 0), 0.25);
  EXPECT_EQ(content.recording.at(0, 1), 1e5);
  EXPECT_EQ(content.recording.at(1, 2), 0.625);
  EXPECT_EQ(content.recording.at(0, 3), 2e-6);
  EXPECT_EQ(content.recording.sequence[1], 1u);
  EXPECT_TRUE(content.filled.empty());
  EXPECT_EQ(content.missing, 0u);
}

TEST(Csv, ConvertsUnitsInBrackets) {
  const CsvContent content = read("t[ms],position[mm],pressure [bar]\r\n0,500,1.5\r\n1,250,2\r\n");
  EXPECT_DOUBLE_EQ(content.recording.time[1], 0.001);
  EXPECT_DOUBLE_EQ(content.recording.at(0, 1), 1.5e5);
  EXPECT_DOUBLE_EQ(content.recording.at(1, 2), 0.25);
  EXPECT_EQ(content.converted.size(), 3u);
}

TEST(Csv, FillsSetPointsAndGroundTruthOnly) {
  const CsvContent content = read("t,position,pressure\n0,1,2\n");
  ASSERT_EQ(content.filled.size(), 2u);
  EXPECT_EQ(content.filled[0], "reference");
  EXPECT_EQ(content.filled[1], "leak");
  EXPECT_EQ(content.recording.at(0, 0), 0);
  EXPECT_EQ(content.recording.at(0, 3), 0);
}

TEST(Csv, MissingNumbersAreCounted) {
  const CsvContent content = read("# a comment\n\nt,position,pressure\n0,,nan\n1,NaN,inf\n2,1,2\n");
  EXPECT_EQ(content.missing, 4u);
  EXPECT_TRUE(std::isnan(content.recording.at(0, 1)));
  EXPECT_TRUE(std::isnan(content.recording.at(1, 2)));
  EXPECT_EQ(content.recording.at(2, 1), 2);
}

TEST(Csv, TimeMayBeWrittenOut) {
  const CsvContent content = read("time[ms],position,pressure\n0,1,2\n500,3,4\n");
  EXPECT_EQ(content.recording.time[1], 0.5);
}

TEST(Csv, BadFilesAreRefusedWithPlaceAndReason) {
  struct Bad {
    const char* text;
    const char* says;
  };
  const Bad bad[] = {
      {"", "empty"},
      {"# only a comment\n", "empty"},
      {"t,position,pressure\n", "no sample"},
      {"position,pressure\n1,2\n", "no column 't'"},
      {"t,position\n0,1\n", "pressure"},
      {"t,position,pressure,speed\n0,1,2,3\n", "'speed' is not a channel of toy"},
      {"t,position,pressure,position\n0,1,2,3\n", "two columns 'position'"},
      {"t,t,position,pressure\n0,1,2,3\n", "two columns of the time"},
      {"t,time,position,pressure\n0,1,2,3\n", "two columns of the time"},
      {"t,position[V],pressure\n0,1,2\n", "'V' cannot be converted to 'm'"},
      {"t,position[mm,pressure\n0,1,2\n", "brackets"},
      {"t,position[ell],pressure\n0,1,2\n", "'ell' is not known"},
      {"t,position,pressure\n0,1,2\n1,two,2\n", "run.csv:3: column 'position': 'two' is not a number"},
      {"t,position,pressure\n0,1,0x10\n", "run.csv:2: column 'pressure'"},
      {"t,position,pressure\n0,1,2 3\n", "'2 3' is not a number"},
      {"t,position,pressure\n0,1\n", "run.csv:2: the line has 2 cells, the header has 3"},
      {"t,position,pressure\n1,1,2\n0.5,1,2\n", "run.csv:3: time runs backwards or stands still: 0.5 s after 1 s"},
      {"t,position,pressure\n1,1,2\n1,1,2\n", "stands still"},
      {"t,position,pressure\nnan,1,2\n", "not a time"},
      {"t,position,pressure\n1e300,1,2\n", "not a time"},
      {"t,sequence,position,pressure\n0,1.5,1,2\n", "not a whole number"},
      {"t,sequence,position,pressure\n0,-1,1,2\n", "not a whole number"},
  };
  for (const Bad& b : bad) {
    try {
      read(b.text);
      ADD_FAILURE() << "accepted: " << b.text;
    } catch (const InputError& error) {
      const std::string text = error.what();
      EXPECT_NE(text.find(b.says), std::string::npos) << text;
      EXPECT_EQ(text.find("run.csv"), 0u) << text;
      EXPECT_EQ(text.find('\n'), std::string::npos) << text;
    }
  }
}

TEST(Csv, WrittenNumbersComeBackBitForBit) {
  std::string text = csv_header(channels(), true);
  const std::vector<double> values = {0.1, -1.0 / 3, 5e-324, std::numeric_limits<double>::quiet_NaN()};
  append_csv_row(text, 0.1 + 0.2, 7, values);  // 0.30000000000000004 is a product of arithmetic, 0.3 what was meant
  append_csv_row(text, 1.0, 18014398509, {1.7976931348623157e308, 0.0, -0.0, 1e22});
  EXPECT_NE(text.find("\n0.3,7,0.1,"), std::string::npos) << text;
  const CsvContent content = read(text);
  EXPECT_EQ(content.recording.sequence[0], 7u);
  EXPECT_EQ(content.recording.sequence[1], 18014398509u);
  for (std::size_t c = 0; c < 3; ++c) EXPECT_EQ(content.recording.at(0, c), values[c]);
  EXPECT_TRUE(std::isnan(content.recording.at(0, 3)));
  EXPECT_EQ(content.recording.at(1, 0), 1.7976931348623157e308);
  EXPECT_TRUE(std::signbit(content.recording.at(1, 2)));
  EXPECT_EQ(content.recording.at(1, 3), 1e22);
}

Sample sample(double time, std::uint64_t sequence, double value = 1) { return {time, sequence, {value}}; }

TEST(SampleCheck, CountsWhatIsWrong) {
  SampleCheck check(0.01);
  check.add(sample(5.00, 0));
  check.add(sample(5.01, 1));
  check.add(sample(5.02, 2, std::nan("")));
  check.add(sample(5.06, 6));  // three lost
  check.add(sample(5.06, 6));  // twice
  check.add(sample(5.05, 5));  // backwards
  check.add(sample(5.06, 7));
  const SampleFindings found = check.findings();
  EXPECT_EQ(found.samples, 7u);
  EXPECT_EQ(found.gaps, 1u);
  EXPECT_NEAR(found.longest_gap, 0.04, 1e-12);
  EXPECT_NEAR(found.first_gap, 5.02, 1e-12);
  EXPECT_EQ(found.duplicates, 1u);
  EXPECT_EQ(found.backward, 1u);
  EXPECT_NEAR(found.first_backward, 5.05, 1e-12);
  EXPECT_EQ(found.missing, 1u);
  EXPECT_EQ(found.lost, 3u + 1u);
  EXPECT_NEAR(found.period, 0.01, 1e-12);
  EXPECT_TRUE(period_fits(found, 0.01));
  EXPECT_FALSE(period_fits(found, 0.02));
  EXPECT_EQ(describe(found, 0.01, 5).size(), 5u);
}

TEST(SampleCheck, SaysNothingOfAGoodRun) {
  SampleCheck check(0.001);
  for (std::uint64_t k = 0; k < 2000; ++k) check.add(sample(0.001 * static_cast<double>(k), k));
  EXPECT_TRUE(describe(check.findings(), 0.001, 0).empty());
}

}  // namespace
}  // namespace faultline
