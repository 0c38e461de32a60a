// Means over rows have no phase, white noise in them stays white, and what is no number or lies on a grid is left.
#include "faultline/segments/averaged_rows.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "rigs/cooling_circuit/recordings.h"

namespace faultline {
namespace {

constexpr double kPeriod = 1e-3;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

Recording empty_run(std::size_t rows) {
  Recording r;
  r.rig = cooling().rig;
  r.channels = cooling().channels;
  Sample sample;
  sample.values.assign(cooling().channels.size(), 1);
  for (std::size_t k = 0; k < rows; ++k) {
    sample.time = kPeriod * static_cast<double>(k);
    r.append(sample);
  }
  return r;
}

template <class Value>
void fill(Recording& r, const std::string& channel, Value&& value) {
  for (std::size_t k = 0; k < r.rows(); ++k) r.values[k * r.columns() + cooling_column(channel)] = value(k);
}

const std::string kPressure = "m_inlet_pressure", kCommand = "bench_valve_command";

TEST(AveragedRows, AreMeansAroundARowOfReadingsAndMeansFromItOnOfCommands) {
  Recording r = empty_run(23);
  const auto value = [](std::size_t k) { return 1e6 + 1e5 * std::sin(0.7 * static_cast<double>(k * k)); };
  fill(r, kPressure, value);
  fill(r, kCommand, [](std::size_t k) { return k < 7 ? 0.0 : 1.0; });
  const Recording means = averaged_rows(cooling(), r, kPeriod, 5);
  ASSERT_EQ(means.rows(), 5u);
  for (std::size_t j = 0; j < means.rows(); ++j) {
    EXPECT_EQ(means.time[j], r.time[5 * j]);
    EXPECT_EQ(means.sequence[j], j);
    if (j == 0) continue;
    double sum = 0;
    for (std::size_t k = 5 * j - 2; k <= 5 * j + 2; ++k) sum += value(k);
    EXPECT_NEAR(means.at(j, cooling_column(kPressure)), sum / 5, 1e-6);
  }
  EXPECT_EQ(means.at(0, cooling_column(kPressure)), value(0));  // no row before it
  EXPECT_EQ(means.at(0, cooling_column(kCommand)), 0);
  EXPECT_NEAR(means.at(1, cooling_column(kCommand)), 3.0 / 5, 1e-12);
  EXPECT_EQ(means.at(4, cooling_column(kCommand)), 1);
}

TEST(AveragedRows, DoNotReachOverABreak) {
  Recording r = empty_run(40);
  for (std::size_t k = 17; k < r.rows(); ++k) r.time[k] += 0.5;
  fill(r, kPressure, [](std::size_t k) { return k < 17 ? 1e6 : 2e6 + static_cast<double>(k * k); });
  const Recording means = averaged_rows(cooling(), r, kPeriod, 5);
  ASSERT_EQ(means.rows(), 4u + 5u);
  EXPECT_EQ(means.time[4], r.time[17]);
  EXPECT_EQ(means.at(3, cooling_column(kPressure)), 1e6);
  EXPECT_EQ(means.at(4, cooling_column(kPressure)), 2e6 + 17 * 17);
}

TEST(AveragedRows, KeepAReadingWhereAMeanWouldHideWhatItIs) {
  Recording r = empty_run(400);
  const Channel& channel = cooling().channels[cooling_column(kPressure)];
  const auto value = [](std::size_t k) { return 1e6 + 1e5 * std::sin(0.7 * static_cast<double>(k * k)); };
  fill(r, kPressure, [&](std::size_t k) { return k == 9 ? kNone : k == 21 ? channel.maximum : value(k); });
  fill(r, "t_mass_flow", [](std::size_t k) { return 0.05 * std::round(20 * std::sin(0.01 * static_cast<double>(k))); });
  const Recording means = averaged_rows(cooling(), r, kPeriod, 5);
  EXPECT_EQ(means.at(2, cooling_column(kPressure)), value(10));
  EXPECT_EQ(means.at(4, cooling_column(kPressure)), value(20));
  EXPECT_NE(means.at(3, cooling_column(kPressure)), value(15));
  for (std::size_t j = 0; j < means.rows(); ++j)  // a grid stays one
    EXPECT_EQ(means.at(j, cooling_column("t_mass_flow")), r.at(5 * j, cooling_column("t_mass_flow")));
}

}  // namespace
}  // namespace faultline
