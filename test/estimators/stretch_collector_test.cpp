// When stretches begin: every so often, the first ones more often, and without a pause while something is undecided.
#include "faultline/estimators/stretch_collector.h"

#include <cmath>

#include <gtest/gtest.h>

#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

// Begins of the stretches of 20 s. Each is judged `latency` s after its end; `undecided` says what of.
template <class Undecided>
std::vector<double> begins(const ResponseSettings& settings, double latency, Undecided undecided) {
  StretchCollector collector(servo(), settings, latency);
  const std::vector<double> row(servo().channels.size(), 0.1);
  std::vector<double> result;
  double ended = 1e9;
  for (int k = 0; k < 20000; ++k) {
    const double time = 1e-3 * k;
    if (time >= ended + latency) {
      collector.judged(undecided(result.back()));
      ended = 1e9;
    }
    const auto stretch = collector.add(time, row.data(), true);
    if (!stretch) continue;
    EXPECT_EQ(ended, 1e9) << "a stretch ended at " << time << " s before the one before it was judged";
    result.push_back(stretch->time.front());
    ended = time;
  }
  return result;
}

ResponseSettings half_seconds() {
  ResponseSettings settings;
  settings.segment_s = 0.1;
  settings.segments = 4;
  settings.every_s = settings.early_every_s = 2;
  settings.early_stretches = 3;
  return settings;
}

TEST(StretchCollector, OneBeginsEveryNowAndThen) {
  const std::vector<double> found = begins(half_seconds(), 1, [](double) { return false; });
  ASSERT_EQ(found.size(), 10u);
  for (std::size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i], 2.0 * static_cast<double>(i), 0.02);
}

TEST(StretchCollector, WhatIsUndecidedIsFollowedWithoutAPause) {
  // Suspected in the stretch at 4 s, settled in the third after it.
  const auto undecided = [](double begin) { return begin > 3.5 && begin < 6.5; };
  const std::vector<double> found = begins(half_seconds(), 1, undecided);
  ASSERT_GT(found.size(), 6u);
  // A stretch of 0.5 s ends when the one before has been judged, 1 s after its end.
  for (std::size_t i = 2; i < 5; ++i) EXPECT_NEAR(found[i], 4 + 1.0 * static_cast<double>(i - 2), 0.02);
  EXPECT_NEAR(found[5], 7, 0.03);
  EXPECT_NEAR(found[6], 9, 0.03);  // nothing is undecided any more
}

TEST(StretchCollector, TheFirstFollowOneAnother) {
  ResponseSettings settings = half_seconds();
  settings.early_every_s = 0.6;
  // Judged within the pause, and later than the next begins.
  for (const double latency : {0.05, 0.3}) {
    const std::vector<double> found = begins(settings, latency, [](double) { return false; });
    ASSERT_GT(found.size(), 5u) << latency;
    EXPECT_NEAR(found[1], 0.6, 0.11) << latency;
    EXPECT_NEAR(found[2], found[1] + 0.6, 0.11) << latency;
    EXPECT_NEAR(found[5] - found[4], 2, 0.02) << latency;
  }
}

}  // namespace
}  // namespace faultline
