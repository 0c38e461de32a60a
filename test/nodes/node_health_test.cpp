#include "nodes/node_health.h"

#include <gtest/gtest.h>

namespace faultline {
namespace {

TEST(Rise, IsToldOnceForEachReportInWhichTheCountWentUp) {
  Rise rise;
  EXPECT_FALSE(rise.since_last(0));
  EXPECT_TRUE(rise.since_last(3));
  EXPECT_FALSE(rise.since_last(3));
  EXPECT_TRUE(rise.since_last(4));
  EXPECT_FALSE(rise.since_last(4));
}

}  // namespace
}  // namespace faultline
