// The grid on which a signal was rounded, and the noise that it is.
#include "faultline/segments/grid_step.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <utility>

#include "faultline/numerics/random.h"
#include "faultline/segments/segmented_run.h"
#include "faultline/segments/smoothing.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

double rounded(double value, double step) { return step * std::round(value / step); }

TEST(GridStep, OfARoundedSignalAndOfOneThatIsNot) {
  Random random(6);
  std::vector<double> fine, coarse, again;
  for (int k = 0; k < 5000; ++k) {
    fine.push_back(std::sin(0.01 * k) + 0.05 * random.normal());
    coarse.push_back(rounded(fine.back(), 0.013) + 0.004);
    again.push_back(rounded(coarse.back(), 0.001));  // as a logger of coarse digits has it
  }
  EXPECT_EQ(grid_step(fine, 0, 3), 0);
  EXPECT_NEAR(grid_step(coarse, 0, 3), 0.013, 1e-9);
  EXPECT_EQ(grid_step(coarse, 0.013, 3), 0);  // what the datasheet knows is no finding
  EXPECT_NEAR(grid_step(again, 0.001, 3), 0.013, 1e-4);
  // Readings that are missing are no level.
  for (std::size_t k = 0; k < fine.size(); k += 3) fine[k] = coarse[k] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(grid_step(fine, 0, 3), 0);
  EXPECT_NEAR(grid_step(coarse, 0, 3), 0.013, 1e-9);
  EXPECT_EQ(grid_step({}, 0, 3), 0);
}

TEST(GridStep, AsksForSomeLevelsEachOftenRead) {
  const std::vector<double> two = {1, 2, 1, 2, 1, 1, 2, 2}, three = {1, 2, 1, 3, 1, 1, 2, 2};
  EXPECT_EQ(grid_step(two, 0, 3), 0);
  EXPECT_EQ(grid_step(three, 0, 3), 1);
  EXPECT_EQ(grid_step(three, 0, 4), 0);
  EXPECT_EQ(grid_step({1, 2, 3, 4}, 0, 3), 0);  // whole numbers that do not come again: counted, not rounded
}

Recording of_readings(const std::vector<double>& readings) {
  Recording r;
  r.channels.resize(1);
  r.channels[0].minimum = -1e9;
  r.channels[0].maximum = 1e9;
  r.values = readings;
  for (std::size_t k = 0; k < readings.size(); ++k) r.time.push_back(1e-3 * static_cast<double>(k));
  return r;
}

// Linear interpolation between samples, `step` of them from one to the next.
std::vector<double> interpolated(const std::vector<double>& y, double begin, double step) {
  std::vector<double> result;
  for (double at = begin; at + 1 < static_cast<double>(y.size()); at += step) {
    const auto k = static_cast<std::size_t>(at);
    const double beyond = at - static_cast<double>(k);
    result.push_back((1 - beyond) * y[k] + beyond * y[k + 1]);
  }
  return result;
}

double scatter(const std::vector<double>& noise) {
  double squares = 0;
  for (const double v : noise) squares += v * v;
  return std::sqrt(squares / static_cast<double>(noise.size()));
}

TEST(NoiseOf, AResamplingIsWhatItLeaves) {
  Random random(4);
  std::vector<double> noise, moving;
  for (int k = 0; k < 12000; ++k) {
    noise.push_back(random.normal());
    moving.push_back(noise.back() + 300 * std::sin(0.02 * k) + 20 * std::sin(0.1 * k));
  }
  EXPECT_NEAR(noise_floor(of_readings(noise), 0), 1, 0.03);
  EXPECT_NEAR(noise_floor(of_readings(moving), 0), 1, 0.1);
  for (const auto& [begin, step] : {std::pair(0.37, 1.0), std::pair(0.5, 1.0), std::pair(0.0, 1 / 1.7)}) {
    SCOPED_TRACE(step);
    const double left = scatter(interpolated(noise, begin, step));
    EXPECT_NEAR(noise_floor(of_readings(interpolated(noise, begin, step)), 0), left, 0.06 * left);
    EXPECT_NEAR(noise_floor(of_readings(interpolated(moving, begin, step)), 0), left, 0.12 * left);
  }
}

// A signal that moves less than a step between samples has third differences of 0, and no level is nearer for that.
TEST(NoiseOf, ACoarseGridIsWhatItTakesAway) {
  const std::size_t position = column("position");
  std::vector<SegmentedRun> runs = {cut_run(servo(), "a", simulate(servo(), servo_setup("multisine"), 6), 0.5)};
  const std::vector<double> fine = noise_of(servo(), runs);
  const double step = 20 * servo().channels[position].noise_std;
  for (std::size_t k = 0; k < runs[0].recording.rows(); ++k) {
    double& value = runs[0].recording.values[k * runs[0].recording.columns() + position];
    value = rounded(value, step);
  }
  ASSERT_LT(noise_floor(runs[0].recording, position), 0.1 * step);
  const std::vector<double> coarse = noise_of(servo(), runs);
  const std::vector<int> outputs = compared_outputs(servo());
  for (std::size_t o = 0; o < outputs.size(); ++o) {
    const auto c = static_cast<std::size_t>(outputs[o]);
    EXPECT_NEAR(coarse[o], c == position ? step / std::sqrt(12.0) : fine[o], 1e-6 * coarse[o]);
  }
}

}  // namespace
}  // namespace faultline
