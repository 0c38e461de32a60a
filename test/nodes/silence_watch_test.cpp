#include "nodes/silence_watch.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace faultline {
namespace {

const double kLive = std::numeric_limits<double>::quiet_NaN();

TEST(SilenceWatch, SaysNothingBeforeTheFirstSample) { EXPECT_TRUE(std::isnan(SilenceWatch(0.5).now(100, kLive))); }

TEST(SilenceWatch, LiveTimeGoesOnAfterThePatience) {
  SilenceWatch watch(0.5);
  watch.arrived(1000, 50, kLive);
  EXPECT_TRUE(std::isnan(watch.now(50.4, kLive)));
  EXPECT_NEAR(watch.now(50.7, kLive), 1000.2, 1e-9);
}

TEST(SilenceWatch, APauseOfTheClockIsNoSilence) {
  SilenceWatch watch(0.5);
  watch.arrived(1000, 50, 7);
  EXPECT_TRUE(std::isnan(watch.now(80, 7)));
  EXPECT_NEAR(watch.now(80, 8.5), 1001.5, 1e-9);
}

TEST(SilenceWatch, AClockThatCatchesUpWithTheLastSampleIsNoSilence) {
  SilenceWatch watch(0.5);
  watch.arrived(1000, 50, 7);
  EXPECT_TRUE(std::isnan(watch.now(50.2, 7)));
  EXPECT_TRUE(std::isnan(watch.now(50.6, 7.3)));  // it stands there: the replay is paused behind that sample
  EXPECT_TRUE(std::isnan(watch.now(60, 7.3)));
  EXPECT_NEAR(watch.now(61, 8.3), 1001, 1e-9);
  watch.arrived(1009, 70, 16);
  EXPECT_TRUE(std::isnan(watch.now(70.6, 16.1)));
}

TEST(SilenceWatch, FastReplayIsNotSilentWithinThePatience) {
  SilenceWatch watch(0.5);
  watch.arrived(1000, 50, 7);
  EXPECT_TRUE(std::isnan(watch.now(50.3, 27)));
  EXPECT_TRUE(std::isnan(watch.now(52, 3)));  // the bag began anew
}

TEST(SilenceWatch, KnowsAStandingClock) {
  SilenceWatch watch(0.5);
  EXPECT_FALSE(watch.clock_stands(10, 3));
  EXPECT_FALSE(watch.clock_stands(10.9, 3));
  EXPECT_TRUE(watch.clock_stands(11.1, 3));
  EXPECT_FALSE(watch.clock_stands(11.2, 3.001));
  EXPECT_FALSE(watch.clock_stands(99, kLive));
}

}  // namespace
}  // namespace faultline
