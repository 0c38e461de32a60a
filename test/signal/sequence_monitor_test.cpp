#include "faultline/signal/sequence_monitor.h"

#include <vector>

#include <gtest/gtest.h>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kPeriod = 1e-3;
constexpr double kEpoch = 1.7e9;

SequenceMonitor monitor(std::uint64_t window = 1000) {
  SequenceSettings settings;
  settings.period = kPeriod;
  settings.window = window;
  return SequenceMonitor(settings);
}

double stamp(std::uint64_t sequence) { return kEpoch + kPeriod * static_cast<double>(sequence); }

TEST(SequenceMonitor, CountsNothingOnAQuietLine) {
  SequenceMonitor m = monitor();
  EXPECT_EQ(m.observe(7, stamp(7)), Arrival::first);
  for (std::uint64_t s = 8; s < 5000; ++s) EXPECT_EQ(m.observe(s, stamp(s)), Arrival::in_order);
  EXPECT_EQ(m.counts().received, 4993u);
  EXPECT_EQ(m.counts().lost + m.counts().duplicate + m.counts().out_of_order + m.counts().late + m.counts().restarts,
            0u);
}

TEST(SequenceMonitor, CountsLostDuplicateAndOutOfOrder) {
  SequenceMonitor m = monitor();
  const std::vector<std::uint64_t> order = {0, 1, 2, 5, 5, 3, 6, 6, 6, 9, 8, 10};
  std::vector<Arrival> arrivals;
  for (const std::uint64_t s : order) arrivals.push_back(m.observe(s, stamp(s)));
  EXPECT_EQ(m.counts().received, order.size());
  EXPECT_EQ(m.counts().lost, 2u);  // 4 and 7
  EXPECT_EQ(m.counts().duplicate, 3u);
  EXPECT_EQ(m.counts().out_of_order, 2u);  // 3 and 8
  EXPECT_EQ(m.counts().restarts, 0u);
  EXPECT_EQ(arrivals[3], Arrival::after_loss);
  EXPECT_EQ(arrivals[4], Arrival::duplicate);
  EXPECT_EQ(arrivals[5], Arrival::out_of_order);
  EXPECT_FALSE(fit(arrivals[4]));
  EXPECT_FALSE(fit(arrivals[5]));
  EXPECT_TRUE(fit(arrivals[3]));
}

TEST(SequenceMonitor, AnEarlierSampleThanTheFirstWasNeverLost) {
  SequenceMonitor m = monitor();
  m.observe(10, stamp(10));
  m.observe(12, stamp(12));
  EXPECT_EQ(m.observe(9, stamp(9)), Arrival::out_of_order);
  EXPECT_EQ(m.counts().lost, 1u);
}

TEST(SequenceMonitor, KnowsARestartByFarLowerNumber) {
  SequenceMonitor m = monitor();
  for (std::uint64_t s = 0; s <= 3000; ++s) m.observe(s, stamp(s));
  EXPECT_EQ(m.observe(0, stamp(0)), Arrival::restart);
  EXPECT_EQ(m.observe(1, stamp(1)), Arrival::in_order);
  EXPECT_EQ(m.counts().restarts, 1u);
  EXPECT_EQ(m.counts().lost, 0u);
}

TEST(SequenceMonitor, KnowsARestartByAStampTheOldNumberingDoesNotExplain) {
  SequenceMonitor m = monitor();
  for (std::uint64_t s = 0; s <= 50; ++s) m.observe(s, stamp(s));
  EXPECT_EQ(m.observe(0, stamp(51)), Arrival::restart);  // the clock went on, the numbers began anew
  EXPECT_EQ(m.observe(1, stamp(52)), Arrival::in_order);
  EXPECT_EQ(m.observe(2, stamp(3)), Arrival::restart);       // the number went on, the clock fell back
  EXPECT_EQ(m.observe(900000, stamp(4)), Arrival::restart);  // numbers from somewhere else, no time passed
  EXPECT_EQ(m.counts().restarts, 3u);
  EXPECT_EQ(m.counts().lost, 0u);
  EXPECT_EQ(m.counts().duplicate, 0u);
}

TEST(SequenceMonitor, ALongGapIsLossWhenTheClockAgrees) {
  SequenceMonitor m = monitor();
  m.observe(0, stamp(0));
  EXPECT_EQ(m.observe(60000, stamp(60000)), Arrival::after_loss);
  EXPECT_EQ(m.counts().lost, 59999u);
}

TEST(SequenceMonitor, OldNumbersDoNotShineThroughAfterALoss) {
  SequenceMonitor m = monitor(16);
  for (std::uint64_t s = 0; s <= 5; ++s) m.observe(s, stamp(s));
  m.observe(30, stamp(30));
  EXPECT_EQ(m.observe(20, stamp(20)), Arrival::out_of_order);
  EXPECT_EQ(m.observe(20, stamp(20)), Arrival::duplicate);
  EXPECT_EQ(m.observe(14, stamp(14)), Arrival::out_of_order);
  EXPECT_EQ(m.observe(13, stamp(13)), Arrival::restart);
}

TEST(SequenceMonitor, LateIsBehindThePace) {
  SequenceMonitor m = monitor();
  for (std::uint64_t s = 0; s < 1000; ++s)
    m.observe(s, stamp(s), 100 + kPeriod * static_cast<double>(s) + (s % 2 ? 0.004 : 0));
  EXPECT_EQ(m.counts().late, 0u);
  // A hold-up of 80 ms: 30 samples come more than 50 ms behind their time.
  for (std::uint64_t s = 1000; s < 1080; ++s) m.observe(s, stamp(s), 100 + kPeriod * 1080);
  EXPECT_EQ(m.counts().late, 30u);
  EXPECT_EQ(m.counts().lost, 0u);
  EXPECT_FALSE(m.last_was_late());
}

TEST(SequenceMonitor, ClocksThatPartSlowlyMakeNothingLate) {
  SequenceMonitor m = monitor();
  for (std::uint64_t s = 0; s < 3600000; s += 100) m.observe(s, stamp(s), 1.0001 * kPeriod * static_cast<double>(s));
  EXPECT_EQ(m.counts().late, 0u);
}

TEST(SequenceMonitor, ResetForgetsEverything) {
  SequenceMonitor m = monitor();
  m.observe(5, stamp(5), 1);
  m.observe(9, stamp(9), 2);
  m.reset();
  EXPECT_EQ(m.counts().received, 0u);
  EXPECT_EQ(m.observe(5, stamp(5), 9), Arrival::first);
  EXPECT_EQ(m.counts().late, 0u);
}

TEST(SequenceMonitor, RefusesSettingsWithoutSense) {
  SequenceSettings settings;
  settings.period = 0;
  EXPECT_THROW(SequenceMonitor{settings}, InputError);
  settings.period = 1e-3;
  settings.window = 0;
  EXPECT_THROW(SequenceMonitor{settings}, InputError);
}

}  // namespace
}  // namespace faultline
