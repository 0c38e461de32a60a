// What a noisy channel shows where its slope counts.
#include <gtest/gtest.h>

#include <cmath>

#include "faultline/numerics/random.h"
#include "faultline/segments/smoothing.h"

namespace faultline {
namespace {

constexpr double kNoise = 0.05, kPeriod = 1e-3;
constexpr std::size_t kRows = 1000, kWidest = 50;

// One second of `signal`, with noise.
template <class Signal>
Recording readings_of(Signal signal) {
  Recording recording;
  recording.channels.resize(1);
  recording.channels.front().minimum = -100;
  recording.channels.front().maximum = 100;
  Random random(7);
  for (std::size_t k = 0; k < kRows; ++k) {
    recording.time.push_back(kPeriod * static_cast<double>(k));
    recording.values.push_back(signal(recording.time.back()) + kNoise * random.normal());
  }
  return recording;
}

TEST(Smoothing, ASlopeComesFromTheWidestWindowThatTheSignalAllows) {
  const auto at = [](double t) { return std::sin(2 * M_PI * t); };
  const Recording recording = readings_of(at);
  double wide = 0, narrow = 0;
  for (std::size_t k = 0; k < kRows; k += 37) {  // the first has no rows before it
    const double slope = kPeriod * 2 * M_PI * std::cos(2 * M_PI * recording.time[k]);
    const Smoothed course = smoothed_course(recording, k, 0, 0, kRows, kNoise, kWidest, {});
    const Smoothed start = smoothed(recording, k, 0, 0, kRows, kNoise, kWidest, {});
    EXPECT_LT(std::abs(course.slope - slope), 3 * course.slope_std) << k;
    EXPECT_LT(std::abs(course.value - at(recording.time[k])), 4 * course.std) << k;
    wide += std::pow(course.slope - slope, 2);
    narrow += std::pow(start.slope - slope, 2);
  }
  EXPECT_LT(std::sqrt(wide), 0.1 * std::sqrt(narrow));
}

TEST(Smoothing, AJumpEndsAWindow) {
  const Recording recording = readings_of([](double t) { return t < 0.5 ? 0.0 : 1.0; });
  for (const std::size_t k : {480, 490, 510, 520}) {
    const Smoothed course = smoothed_course(recording, k, 0, 0, kRows, kNoise, kWidest, {});
    EXPECT_NEAR(course.value, k < 500 ? 0 : 1, 4 * kNoise) << k;
    EXPECT_LT(std::abs(course.slope), 0.05) << k;
  }
}

}  // namespace
}  // namespace faultline
