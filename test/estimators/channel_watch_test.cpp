// Readings that are not like their transducer's, and healthy ones that move, stand still or are rounded.
#include "faultline/estimators/channel_watch.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>
#include <vector>

#include "allocations.h"

namespace faultline {
namespace {

Channel pressure() {
  Channel c;
  c.name = "pressure";
  c.unit = "Pa";
  c.minimum = 0;
  c.maximum = 1e7;
  c.noise_std = 1e4;
  c.resolution = 500;
  return c;
}

// What is said over `rows` readings of 1 kHz that swing by 2 MPa at 5 Hz, with steps of 1 MPa every 0.2 s.
template <class Spoil>
std::set<ChannelStatus> said(const Channel& channel, int rows, const Spoil& spoil) {
  std::mt19937_64 generator(7);
  std::normal_distribution<double> noise(0, channel.noise_std);
  ChannelWatch watch(channel);
  std::set<ChannelStatus> all;
  double last = 0;
  for (int k = 0; k < rows; ++k) {
    const double clean = 5e6 + 2e6 * std::sin(0.0314 * k) + (k / 200 % 2 == 0 ? 0 : 1e6);
    const double rounded = channel.resolution * std::round((clean + noise(generator)) / channel.resolution);
    last = spoil(k, rounded, last);
    all.insert(watch.add(last));
  }
  return all;
}

using Said = std::set<ChannelStatus>;

TEST(ChannelWatch, AHealthyTransducerThatMovesIsGood) {
  EXPECT_EQ(said(pressure(), 200000, [](int, double x, double) { return x; }), Said{ChannelStatus::good});
}

TEST(ChannelWatch, EachTroubleHasItsName) {
  std::mt19937_64 generator(8);
  std::normal_distribution<double> noise(0, 2e5);
  const auto good_and = [](ChannelStatus status) { return Said{ChannelStatus::good, status}; };
  EXPECT_EQ(said(pressure(), 2000, [](int k, double x, double last) { return k < 1000 ? x : last; }),
            good_and(ChannelStatus::frozen));
  EXPECT_EQ(said(pressure(), 2000, [](int k, double x, double last) { return k % 10 == 0 ? x : last; }),
            good_and(ChannelStatus::frozen));
  EXPECT_EQ(said(pressure(), 2000, [&](int k, double x, double) { return k < 1000 ? x : x + noise(generator); }),
            good_and(ChannelStatus::noisy));
  EXPECT_EQ(said(pressure(), 2000, [](int k, double x, double) { return k % 100 == 50 ? 1e6 : x; }),
            good_and(ChannelStatus::spiky));
  for (const double unit : {1e5, 1e3, 6894.76})
    EXPECT_EQ(said(pressure(), 2000, [&](int, double x, double) { return x / unit; }), good_and(ChannelStatus::quiet));
}

// Sines up to two thirds of half the sample rate.
TEST(ChannelWatch, AFastMotionIsNoNoise) {
  const auto fast = [](int k, double x, double) {
    double sum = 0;
    for (int i = 1; i <= 40; ++i) sum += std::sin(2 * M_PI * 0.008 * i * k + 7.0 * i * i);
    return x + 1e5 * sum;
  };
  EXPECT_EQ(said(pressure(), 20000, fast), Said{ChannelStatus::good});
}

// An input may change with every sample; of an output, which goes through the rig, that is noise.
TEST(ChannelWatch, AnInputMayBeMovedAsFastAsItIsSampled) {
  std::mt19937_64 generator(9);
  std::normal_distribution<double> motion(0, 4e5);
  const auto moved = [&](int, double x, double) { return x + motion(generator); };
  Channel channel = pressure();
  channel.role = Role::input;
  EXPECT_EQ(said(channel, 20000, moved), Said{ChannelStatus::good});
  channel.role = Role::output;
  EXPECT_EQ(said(channel, 20000, moved), (Said{ChannelStatus::good, ChannelStatus::noisy}));
  channel.role = Role::input;
  const auto noisy = [&](int, double x, double) { return x + 0.3 * motion(generator); };
  EXPECT_EQ(said(channel, 20000, noisy), (Said{ChannelStatus::good, ChannelStatus::noisy}));
}

TEST(ChannelWatch, AnEndOfTheRangeIsNoTrouble) {
  EXPECT_EQ(said(pressure(), 2000, [](int, double, double) { return 0.0; }),
            (Said{ChannelStatus::good, ChannelStatus::at_end}));
}

TEST(ChannelWatch, WithoutDeclaredNoiseNothingIsJudged) {
  Channel command = pressure();
  command.noise_std = 0;
  EXPECT_EQ(said(command, 2000, [](int, double, double) { return 3.0; }), Said{ChannelStatus::good});
  Channel setpoint = pressure();
  setpoint.role = Role::setpoint;
  EXPECT_EQ(said(setpoint, 2000, [](int, double, double) { return 3.0; }), Said{ChannelStatus::good});
}

TEST(ChannelWatch, OfACommandThatIsMeasuredOnlyStandstillIsTold) {
  Channel command = pressure();
  command.role = Role::command;
  EXPECT_EQ(said(command, 2000, [](int k, double x, double last) { return k < 1000 ? x : last; }),
            (Said{ChannelStatus::good, ChannelStatus::frozen}));
  EXPECT_EQ(said(command, 2000, [](int k, double x, double) { return k % 2 == 0 ? x : x + 3e5; }),
            Said{ChannelStatus::good});
}

TEST(ChannelWatch, AllocatesNothing) {
  ChannelWatch watch(pressure());
  const std::uint64_t before = allocations();
  for (int k = 0; k < 1000; ++k) watch.add(1e6 + k % 7);
  EXPECT_EQ(allocations(), before);
}

}  // namespace
}  // namespace faultline
