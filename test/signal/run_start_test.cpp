#include "faultline/signal/run_start.h"

#include <gtest/gtest.h>

namespace faultline {
namespace {

constexpr double kStart = 1.7e9;

Sample sample(double after, std::uint64_t number) {
  Sample made;
  made.time = kStart + after;
  made.sequence = number;
  return made;
}

TEST(RunStart, CountsFromTheStampOfTheDescription) {
  RunStart start(1e-3);
  start.describe(kStart);
  start.add(sample(0.196, 0));  // numbers may begin anew on the way
  start.add(sample(5, 5000));
  EXPECT_EQ(start.missed(), 196u);
  EXPECT_EQ(start.certain(), 196u);
}

TEST(RunStart, TheNumberAloneIsNotCertain) {
  RunStart start(1e-3);
  start.add(sample(0.196, 196));
  start.add(sample(5, 5000));
  EXPECT_EQ(start.missed(), 196u);
  EXPECT_EQ(start.certain(), 0u);
}

TEST(RunStart, NothingIsMissedOfAWholeRunNorIsTimeBeforeItsStart) {
  for (const double after : {0.0, 0.0004, -3.0}) {
    RunStart start(1e-3);
    start.describe(kStart);
    start.add(sample(after, 0));
    EXPECT_EQ(start.missed(), 0u) << after;
  }
}

TEST(RunStart, ARunThatIsDescribedAnewCountsOnceMore) {
  RunStart start(0.01);
  start.describe(kStart);
  start.add(sample(0.1, 10));
  start.describe(kStart + 50);
  start.add(sample(50.07, 7));
  start.describe(0);  // says nothing of its start
  start.add(sample(60, 1007));
  EXPECT_EQ(start.missed(), 17u);
}

}  // namespace
}  // namespace faultline
