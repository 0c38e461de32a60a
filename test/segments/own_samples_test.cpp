// Readings that were interpolated onto a finer grid are known for that, and what they were made of is found again.
#include "faultline/segments/own_samples.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

Recording run() { return simulate(servo(), servo_setup("multisine"), 4); }

// At `step` rows of r from one sample to the next, interpolated back onto its rows.
Recording interpolated(const Recording& r, double step) {
  Recording result = r;
  const auto at = [&](double row, std::size_t c) {
    const auto k = std::min(static_cast<std::size_t>(row), r.rows() - 2);
    const double beyond = row - static_cast<double>(k);
    return (1 - beyond) * r.at(k, c) + beyond * r.at(k + 1, c);
  };
  for (std::size_t k = 0; k < r.rows(); ++k)
    for (std::size_t c = 0; c < r.columns(); ++c) {
      const double sample = std::floor(static_cast<double>(k) / step) * step;
      const double share = (static_cast<double>(k) - sample) / step;
      result.values[k * r.columns() + c] = (1 - share) * at(sample, c) + share * at(sample + step, c);
    }
  return result;
}

TEST(OwnSamples, OfWhatWasInterpolatedAreThoseBetweenWhichItsLinesRun) {
  const Recording r = run();
  for (const std::size_t every : {2u, 5u, 6u, 20u}) {
    const OwnSamples own = own_samples(interpolated(r, static_cast<double>(every)));
    EXPECT_EQ(own.every, every);
    EXPECT_EQ(own.first, 0u);
    const Recording thin = at_own_samples(interpolated(r, static_cast<double>(every)), own);
    EXPECT_EQ(thin.rows(), (r.rows() + every - 1) / every);
    for (std::size_t k = 0; k + 1 < thin.rows(); ++k) {
      EXPECT_EQ(thin.time[k], r.time[k * every]);
      for (std::size_t c = 0; c < r.columns(); ++c) EXPECT_EQ(thin.at(k, c), r.at(k * every, c));
    }
  }
  Recording later = interpolated(r, 5);
  later.time.erase(later.time.begin(), later.time.begin() + 3);
  later.values.erase(later.values.begin(), later.values.begin() + 3 * static_cast<std::ptrdiff_t>(r.columns()));
  EXPECT_EQ(own_samples(later).every, 5u);
  EXPECT_EQ(own_samples(later).first, 2u);
}

TEST(OwnSamples, OfOthersAreTheirRows) {
  const Recording r = run();
  EXPECT_EQ(own_samples(r).every, 1u);
  EXPECT_EQ(own_samples(interpolated(r, 1.7)).every, 1u);
  EXPECT_EQ(own_samples(interpolated(r, 4.5)).every, 1u);
  Recording mixed = interpolated(r, 5);  // one transducer of its own rate
  for (std::size_t k = 0; k < r.rows(); ++k) {
    const std::size_t at = k * r.columns() + column("chamber_a_pressure");
    mixed.values[at] = r.values[at];
  }
  EXPECT_EQ(own_samples(mixed).every, 1u);
  Recording driven = interpolated(r, 5);  // commands faster than the transducers
  Recording held = driven;                // ... and held from one of their samples to the next
  for (std::size_t k = 0; k < r.rows(); ++k) {
    const std::size_t at = k * r.columns() + column("valve_command");
    driven.values[at] = r.values[at];
    held.values[at] = r.at(k / 5 * 5, column("valve_command"));
  }
  EXPECT_EQ(own_samples(driven).every, 1u);
  EXPECT_EQ(own_samples(held).every, 5u);
  Recording still = r;  // nothing moves
  for (std::size_t k = 0; k < r.rows(); ++k)
    for (std::size_t c = 0; c < r.columns(); ++c) still.values[k * r.columns() + c] = 1;
  EXPECT_EQ(own_samples(still).every, 1u);
  EXPECT_EQ(own_samples(Recording()).every, 1u);
}

}  // namespace
}  // namespace faultline
