#include "faultline/signal/stream_watch.h"

#include <gtest/gtest.h>

#include <cmath>

namespace faultline {
namespace {

constexpr double kPeriod = 1e-3;

// Each kind of trouble, and that it is over with the first whole window without it.
struct Spoil {
  const char* words;
  std::uint64_t (*sequence)(std::uint64_t);
  double (*stamp)(std::uint64_t);
};

double even(std::uint64_t k) { return 1e9 + static_cast<double>(k) * kPeriod; }
std::uint64_t counted(std::uint64_t k) { return k; }

class StreamTrouble : public ::testing::TestWithParam<Spoil> {};

TEST_P(StreamTrouble, IsNamedAndCleared) {
  StreamWatch watch(kPeriod);
  for (std::uint64_t k = 0; k < 200; ++k) watch.add(k, even(k));
  EXPECT_EQ(watch.trouble(), "");
  for (std::uint64_t k = 200; k < 400; ++k) watch.add(GetParam().sequence(k), GetParam().stamp(k));
  EXPECT_NE(watch.trouble().find(GetParam().words), std::string::npos) << watch.trouble();
  for (std::uint64_t k = 1000; k < 1200; ++k) watch.add(k, even(k));
  EXPECT_EQ(watch.trouble(), "");
}

INSTANTIATE_TEST_SUITE_P(
    Kinds, StreamTrouble,
    ::testing::Values(
        Spoil{"stamps are 0", counted, [](std::uint64_t) { return 0.0; }},
        Spoil{"stand still", counted, [](std::uint64_t) { return even(200); }},
        Spoil{"do not count (all are 7)", [](std::uint64_t) { return std::uint64_t{7}; }, even},
        Spoil{"count down", [](std::uint64_t k) { return 1000 - k; }, even},
        Spoil{"count in steps of 10", [](std::uint64_t k) { return 10 * k; }, even},
        Spoil{"jump about", [](std::uint64_t k) { return k * k * k % 997; }, even},
        Spoil{"jump about", [](std::uint64_t k) { return k * (k + 1) / 2; }, even},
        Spoil{"every 0.01 s", counted, [](std::uint64_t k) { return even(10 * k); }},
        Spoil{"every 0.00098 s", counted, [](std::uint64_t k) { return even(0) + 0.98e-3 * static_cast<double>(k); }},
        Spoil{"jitter", counted,
              [](std::uint64_t k) { return even(k) + 0.4 * kPeriod * std::sin(2.3 * static_cast<double>(k)); }},
        Spoil{"jitter", counted, [](std::uint64_t k) { return even(k) + (k % 2 ? 0.4e-3 : 0); }}));

TEST(StreamWatch, LossesAndSmallJitterAreNoTrouble) {
  StreamWatch watch(kPeriod);
  for (std::uint64_t k = 0; k < 1000; ++k) {
    if (k % 3 == 0) continue;
    watch.add(k, even(k) + 0.05 * kPeriod * std::sin(2.3 * static_cast<double>(k)));
    EXPECT_EQ(watch.trouble(), "") << k;
  }
}

TEST(StreamWatch, APauseOfTheSourceIsNoTrouble) {
  StreamWatch watch(kPeriod);
  for (std::uint64_t k = 0; k < 1000; ++k) {
    watch.add(k, even(k) + (k < 450 ? 0 : 5));
    EXPECT_EQ(watch.trouble(), "") << k;
  }
}

TEST(StreamWatch, ASlowRigIsJudgedAfterTenSamples) {
  StreamWatch watch(100);
  for (std::uint64_t k = 0; k < 10; ++k) watch.add(k, 50 * static_cast<double>(k + 1));
  EXPECT_EQ(watch.trouble(), "samples come every 50 s, the rig's datasheet says 100 s");
}

}  // namespace
}  // namespace faultline
