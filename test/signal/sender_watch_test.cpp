#include "faultline/signal/sender_watch.h"

#include <gtest/gtest.h>

#include <random>

namespace faultline {
namespace {

constexpr double kPeriod = 1e-3;
constexpr double kEpoch = 1.7e9;

struct Sender {
  std::uint64_t number;
  double offset;  // s

  double stamp() const { return kEpoch + offset + kPeriod * static_cast<double>(number); }
};

// Sends `count` samples; how many of them were own.
std::uint64_t send(SenderWatch& watch, Sender& sender, double& arrival, int count = 1) {
  std::uint64_t own = 0;
  for (int k = 0; k < count; ++k, ++sender.number) own += watch.own(sender.number, sender.stamp(), arrival += kPeriod);
  return own;
}

TEST(SenderWatch, OneSenderIsOwnWithLossesRestartsAndJitter) {
  SenderWatch watch(kPeriod);
  double arrival = 0;
  Sender sender{0, 0};
  EXPECT_EQ(send(watch, sender, arrival, 2000), 2000u);
  sender.number += 5000;  // lost
  EXPECT_EQ(send(watch, sender, arrival, 2000), 2000u);
  sender = {0, 9};  // begins anew, the clock goes on
  EXPECT_EQ(send(watch, sender, arrival, 2000), 2000u);
  sender = {0, 0};  // a log that is played again
  EXPECT_EQ(send(watch, sender, arrival, 2000), 2000u);
  for (std::uint64_t k = 2000; k < 4000; ++k)
    EXPECT_TRUE(watch.own(k, kEpoch + kPeriod * static_cast<double>(k) + (k % 10 == 0 ? 3e-3 : 0), arrival += kPeriod));
  EXPECT_EQ(watch.foreign(), 0u);
}

class TwoSenders : public ::testing::TestWithParam<Sender> {};

TEST_P(TwoSenders, TheFirstCountsUntilItEnds) {
  SenderWatch watch(kPeriod);
  double arrival = 0;
  Sender first{3000, 0}, second = GetParam();
  send(watch, first, arrival, 100);
  for (int k = 0; k < 20; ++k) {  // until it is sure
    send(watch, first, arrival);
    send(watch, second, arrival);
  }
  for (int round = 0; round < 500; ++round) {
    EXPECT_EQ(send(watch, first, arrival, 1 + round % 3), 1u + static_cast<unsigned>(round % 3));
    EXPECT_EQ(send(watch, second, arrival, 1 + round % 4), 0u);
  }
  EXPECT_GT(watch.foreign(), 1000u);
  // The first ends: after a second the other one counts, and nothing is foreign any more.
  send(watch, second, arrival, 1100);
  const std::uint64_t told = watch.foreign();
  EXPECT_EQ(send(watch, second, arrival, 1000), 1000u);
  EXPECT_EQ(watch.foreign(), told);
}

// Another clock, another start, numbers beside the first's and far from them.
INSTANTIATE_TEST_SUITE_P(Kinds, TwoSenders,
                         ::testing::Values(Sender{0, 3}, Sender{3050, -0.45}, Sender{3100, 50}, Sender{900000, 0},
                                           Sender{2990, 0.11}));

TEST(SenderWatch, NumbersThatDoNotCountAreAllOwn) {
  std::mt19937 chance(1);
  std::uint64_t (*const kinds[])(std::uint64_t, std::mt19937&) = {
      [](std::uint64_t, std::mt19937&) { return std::uint64_t{7}; },
      [](std::uint64_t k, std::mt19937&) { return 1000000 - k; },
      [](std::uint64_t k, std::mt19937&) { return 2 * k; },
      [](std::uint64_t k, std::mt19937&) { return 10 * k; },
      [](std::uint64_t, std::mt19937& from) { return std::uint64_t{from()}; },
      [](std::uint64_t, std::mt19937& from) { return std::uint64_t{from() % 10}; },
  };
  for (const auto number : kinds) {
    SenderWatch watch(kPeriod);
    for (std::uint64_t k = 0; k < 20000; ++k) {
      const double seconds = kPeriod * static_cast<double>(k);
      EXPECT_TRUE(watch.own(number(k, chance), kEpoch + seconds, seconds));
    }
  }
}

}  // namespace
}  // namespace faultline
