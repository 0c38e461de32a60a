#include "nodes/clock_watch.h"

#include <gtest/gtest.h>

namespace faultline {
namespace {

TEST(ClockWatch, MissesAClockAfterAWhileAndUntilItComes) {
  ClockWatch watch;
  EXPECT_FALSE(watch.missing(0, false));
  EXPECT_FALSE(watch.missing(100, true));
  EXPECT_FALSE(watch.missing(104.9, true));
  EXPECT_TRUE(watch.missing(105.1, true));
  EXPECT_FALSE(watch.missing(106, false));
  EXPECT_FALSE(watch.missing(107, true));
}

}  // namespace
}  // namespace faultline
