#include "nodes/sample_gate.h"

#include <vector>

#include <gtest/gtest.h>

namespace faultline {
namespace {

struct Gate {
  Datasheet sheet;
  std::vector<std::vector<double>> passed;
  std::vector<double> arrivals;
  SampleGate gate{sheet, 1.0, 3, [this](const Sample& sample, double arrival) {
                    passed.push_back(sample.values);
                    arrivals.push_back(arrival);
                  }};
  Gate() {
    sheet.rig = "small";
    sheet.file = "small.yaml";
    Channel a, b;
    a.name = "a";
    a.unit = "V";
    b.name = "b";
    b.unit = "Pa";
    sheet.channels = {a, b};
  }
  static Sample sample(std::vector<double> values) {
    Sample result;
    result.values = std::move(values);
    return result;
  }
};

TEST(SampleGate, HoldsSamplesUntilTheyAreDescribed) {
  Gate g;
  g.gate.push(Gate::sample({1, 2}), 10);
  g.gate.push(Gate::sample({3, 4}), 10.1);
  EXPECT_TRUE(g.passed.empty());
  Description swapped = describe(g.sheet, "");
  std::swap(swapped.names[0], swapped.names[1]);
  std::swap(swapped.units[0], swapped.units[1]);
  g.gate.describe(swapped);
  g.gate.push(Gate::sample({5, 6}), 10.2);
  EXPECT_EQ(g.passed, (std::vector<std::vector<double>>{{2, 1}, {4, 3}, {6, 5}}));
  EXPECT_EQ(g.arrivals, (std::vector<double>{10, 10.1, 10.2}));
  EXPECT_TRUE(g.gate.trouble().empty());
}

TEST(SampleGate, TakesTheOrderForGrantedAfterTheWait) {
  Gate g;
  g.gate.push(Gate::sample({1, 2}), 10);
  g.gate.tick(10.9);
  EXPECT_TRUE(g.passed.empty());
  g.gate.tick(11.1);
  EXPECT_EQ(g.passed.size(), 1u);
  EXPECT_NE(g.gate.trouble().find("no description came within 1 s"), std::string::npos);
  g.gate.describe(describe(g.sheet, ""));
  EXPECT_TRUE(g.gate.trouble().empty());
}

TEST(SampleGate, HoldsNoMoreThanItsCapacity) {
  Gate g;
  for (int i = 0; i < 5; ++i) g.gate.push(Gate::sample({1.0 * i, 0}), 10);
  g.gate.describe(describe(g.sheet, ""));
  ASSERT_EQ(g.passed.size(), 3u);
  EXPECT_EQ(g.passed[0][0], 2);
  EXPECT_EQ(g.gate.refused(), 2u);
}

TEST(SampleGate, RefusesWhatIsDescribedWrongUntilItIsRight) {
  Gate g;
  g.gate.push(Gate::sample({1, 2}), 10);
  Description wrong = describe(g.sheet, "");
  wrong.units[1] = "bar";
  g.gate.describe(wrong);
  g.gate.push(Gate::sample({1, 2}), 20);
  EXPECT_TRUE(g.passed.empty());
  EXPECT_TRUE(g.gate.refusing());
  EXPECT_EQ(g.gate.refused(), 2u);
  EXPECT_NE(g.gate.trouble().find("'bar'"), std::string::npos);
  g.gate.describe(describe(g.sheet, ""));
  g.gate.push(Gate::sample({3, 4}), 21);
  EXPECT_EQ(g.passed.size(), 1u);
}

TEST(SampleGate, RefusesSamplesOfAnotherLength) {
  Gate g;
  g.gate.describe(describe(g.sheet, ""));
  g.gate.push(Gate::sample({1, 2, 3}), 10);
  EXPECT_TRUE(g.passed.empty());
  EXPECT_EQ(g.gate.refused(), 1u);
  EXPECT_NE(g.gate.refusal().find("3 values"), std::string::npos);
}

}  // namespace
}  // namespace faultline
