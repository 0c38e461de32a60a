#include "faultline/signal/csv_table.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "faultline/signal/csv.h"
#include "faultline/signal/date_time.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

const std::string kFile = "stand.csv";

struct Read {
  std::vector<std::string> names;
  std::vector<std::vector<double>> rows;
  CsvDialect dialect;
};

Read read(const std::string& text, const CsvDialect& dialect = {}) {
  CsvTable table(text, kFile, dialect);
  Read read{table.names(), {}, table.dialect()};
  while (table.next()) {
    read.rows.emplace_back();
    for (std::size_t c = 0; c < read.names.size(); ++c) read.rows.back().push_back(table.number(c));
  }
  return read;
}

using Row = std::vector<double>;
using Names = std::vector<std::string>;

TEST(CsvTable, SeparatorAndDecimalSignAreSeen) {
  struct Case {
    const char* text;
    char separator, decimal;
  };
  const Case cases[] = {
      {"a,b\n1.5,-2e3\n", ',', '.'},
      {"a;b\n1,5;-2e3\n", ';', ','},
      {"a;b\n1.5;-2e3\n", ';', '.'},
      {"a\tb\n1,5\t-2e3\n", '\t', ','},
      {"a\tb\r\n1.5\t-2e3\r\n", '\t', '.'},
      {"a,b\n\"1,5\",-2e3\n", ',', ','},
      {"\xEF\xBB\xBF\"a\";\"b\"\r\n\"1,5\";\"-2e3\"\r\n", ';', ','},
      {"\"a\";b\n1,5;-2e3;\n", ';', ','},
      {"a,b,\n1.5,-2e3,\n", ',', '.'},
      {"# made by a; logger; with; notes\na,b\n\n1.5,-2e3\n", ',', '.'},
  };
  for (const Case& c : cases) {
    const Read got = read(c.text);
    EXPECT_EQ(got.dialect.separator, c.separator) << c.text;
    EXPECT_EQ(got.dialect.decimal, c.decimal) << c.text;
    EXPECT_EQ(got.names, (Names{"a", "b"})) << c.text;
    ASSERT_EQ(got.rows.size(), 1u) << c.text;
    EXPECT_EQ(got.rows[0], (Row{1.5, -2000})) << c.text;
  }
}

TEST(CsvTable, ASemicolonInANameIsNoSeparator) {
  const Read got = read("\"p; supply\",b\n1.5,2\n");
  EXPECT_EQ(got.names, (Names{"p; supply", "b"}));
  EXPECT_EQ(got.dialect.separator, ',');
}

TEST(CsvTable, QuotesInQuotes) {
  const Read got = read("\"5\"\" pipe\",\" b \"\n\"1\",2\n");
  EXPECT_EQ(got.names, (Names{"5\" pipe", "b"}));
  EXPECT_EQ(got.rows[0], (Row{1, 2}));
}

TEST(CsvTable, EmptyCellsAndTextForMissingAreNan) {
  const Read got = read("a;b;c\n;nan;1,5\n1;;\n");
  ASSERT_EQ(got.rows.size(), 2u);
  EXPECT_TRUE(std::isnan(got.rows[0][0]) && std::isnan(got.rows[0][1]));
  EXPECT_EQ(got.rows[0][2], 1.5);
  EXPECT_EQ(got.rows[1][0], 1);
  EXPECT_TRUE(std::isnan(got.rows[1][1]) && std::isnan(got.rows[1][2]));
}

TEST(CsvTable, HeaderLinesCanBeSkippedAndOtherComments) {
  CsvDialect dialect;
  dialect.names_line = 3;
  dialect.data_line = 5;
  const Read got = read("Logger 7;serial 4711\nstarted 2024-03-01\nt;p\ns;bar\n0;1,5\n1;2,5\n", dialect);
  EXPECT_EQ(got.names, (Names{"t", "p"}));
  ASSERT_EQ(got.rows.size(), 2u);
  EXPECT_EQ(got.rows[1], (Row{1, 2.5}));

  CsvDialect percent;
  percent.comment = '%';
  EXPECT_EQ(read("% said\na,b\n1,2\n%end\n", percent).rows.size(), 1u);
}

TEST(CsvTable, WithoutNamesColumnsAreCounted) {
  CsvDialect dialect;
  dialect.names_line = 0;
  const Read got = read("0;1,5\n1;2,5\n", dialect);
  EXPECT_EQ(got.names, (Names{"1", "2"}));
  ASSERT_EQ(got.rows.size(), 2u);
  EXPECT_EQ(got.rows[0], (Row{0, 1.5}));
}

TEST(CsvTable, TheDialectCanBeFixed) {
  CsvDialect dialect;
  dialect.separator = ';';
  dialect.decimal = ',';
  const Read got = read("a;b\n1,5;2,5\n", dialect);
  EXPECT_EQ(got.rows[0], (Row{1.5, 2.5}));
}

TEST(CsvTable, WhatCannotBeReadIsToldWithItsPlace) {
  struct Case {
    const char* text;
    const char* says;
  };
  const Case cases[] = {
      {"", "stand.csv: the file is empty"},
      {"a;b\n1,5;2.5\n", "stand.csv: there are numbers such as 2.5 and such as 1,5"},
      {"a;b\n1.234,5;2\n", "stand.csv:2: column 'a': '1.234,5' is not a number"},
      {"a;b\n1;two\n", "stand.csv:2: column 'b': 'two' is not a number"},
      {"a,b\n1,2\n1,2,3\n", "stand.csv:3: the line has 3 cells, the header has 2"},
      {"a;b\n1;2\n1\n", "stand.csv:3: the line has 1 cells, the header has 2"},
      {"a,b\n1,2\n\"1,2\n", "stand.csv:3: a quote is opened and not closed"},
      {"a,b\n1,2\n\"1\"x,2\n", "stand.csv:3: text follows a closing quote"},
      {"a,b\n1,0x10\n", "'0x10' is not a number"},
      {"a,b\r1,2\r3,4\r", "stand.csv: its lines end with a carriage return alone"},
      {"\xFF\xFE"
       "a",
       "stand.csv: the file is not text in UTF-8"},
  };
  for (const Case& c : cases) {
    try {
      read(c.text);
      ADD_FAILURE() << "accepted: " << c.text;
    } catch (const InputError& error) {
      const std::string text = error.what();
      EXPECT_NE(text.find(c.says), std::string::npos) << text;
      EXPECT_EQ(text.find("stand.csv:"), 0u) << text;
      EXPECT_EQ(text.find('\n'), std::string::npos) << text;
    }
  }
}

TEST(CsvTable, NamesBelowTheLastLineAreToldWithBothLines) {
  CsvDialect dialect;
  dialect.names_line = 5;
  try {
    read("a,b\n1,2\n", dialect);
    ADD_FAILURE();
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(),
                 "stand.csv: no names in line 5 (names_line of the mapping) or below; the file has 2 lines");
  }
}

TEST(CsvTable, RecordingsOfARigMayHaveAnyDialect) {
  Channel channel;
  channel.name = "pressure";
  channel.unit = "Pa";
  const std::string rig = "toy", text = "\xEF\xBB\xBFt[ms];\"pressure[bar]\"\r\n0;1,5\r\n10;2\r\n";
  const CsvContent content = read_csv(text, kFile, rig, {channel});
  ASSERT_EQ(content.recording.rows(), 2u);
  EXPECT_DOUBLE_EQ(content.recording.time[1], 0.01);
  EXPECT_DOUBLE_EQ(content.recording.at(0, 0), 1.5e5);
}

TEST(DateTime, IsReadAsSecondsSince2000) {
  struct Case {
    const char* text;
    const char* format;
    double seconds;
  };
  const Case cases[] = {
      {"2000-01-01T00:00:00Z", "", 0},
      {"2000-01-01 00:01:00,25", "", 60.25},
      {"2000-01-02T00:00", "", 86400},
      {"2000-01-01T01:00:00.5+01:00", "", 0.5},
      {"1999-12-31T23:00:00-0130", "", -3600 + 5400},
      {"2024-03-01T12:30:05.125", "", 762611405.125},
      {"02.01.2000 00:00:01,5", "%d.%m.%Y %H:%M:%S", 86401.5},
      {"12:00:00.25", "%H:%M:%S", 43200.25},
      {"10:00:01.5 PM 01/02/2000", "%I:%M:%S %p %m/%d/%Y", 86400 + 79201.5},
  };
  for (const Case& c : cases) {
    const auto got = parse_date_time(c.text, c.format);
    ASSERT_TRUE(got.has_value()) << c.text;
    EXPECT_DOUBLE_EQ(*got, c.seconds) << c.text;
  }
  for (const char* text : {"", "yesterday", "2000-13-01T00:00:00", "2000-01-01T00:61:00", "2000-01-01T00:00:00 later"})
    EXPECT_FALSE(parse_date_time(text, "").has_value()) << text;
  EXPECT_FALSE(parse_date_time("01.02.2000", "%d.%m.%Y %H:%M:%S").has_value());
}

}  // namespace
}  // namespace faultline
