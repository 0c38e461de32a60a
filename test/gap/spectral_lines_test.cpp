#include "faultline/gap/spectral_lines.h"

#include <gtest/gtest.h>

#include <cmath>

#include "faultline/numerics/random.h"

namespace faultline {
namespace {

constexpr double kPeriod = 1e-3;
const std::vector<double> kPeriods(2, kPeriod);

// Two runs of white noise, with sines of these frequencies in the first column of the second.
std::vector<Eigen::MatrixXf> runs_with(const std::vector<double>& frequencies, double amplitude) {
  Random random(5);
  std::vector<Eigen::MatrixXf> runs(2, Eigen::MatrixXf(8000, 2));
  for (Eigen::MatrixXf& run : runs)
    for (Eigen::Index i = 0; i < run.size(); ++i) run.data()[i] = static_cast<float>(random.normal());
  for (Eigen::Index k = 0; k < 8000; ++k)
    for (const double f : frequencies)
      runs[1](k, 0) +=
          static_cast<float>(amplitude * std::sin(6.283185307179586 * f * static_cast<double>(k) * kPeriod));
  return runs;
}

TEST(SpectralLines, AreFoundToAFractionOfOneOverTheRun) {
  const auto lines = spectral_lines(runs_with({17.31, 41.07}, 0.5), kPeriods, 1, 60);
  ASSERT_GE(lines.size(), 2u);
  const double first = std::min(lines[0], lines[1]), second = std::max(lines[0], lines[1]);
  EXPECT_NEAR(first, 17.31, 0.25 / 8);
  EXPECT_NEAR(second, 41.07, 0.25 / 8);
}

TEST(SpectralLines, OutOfRangeAndSideLobesDoNotCount) {
  EXPECT_EQ(spectral_lines(runs_with({17.31}, 2), kPeriods, 1, 60).size(), 1u);
  EXPECT_TRUE(spectral_lines(runs_with({17.31}, 2), kPeriods, 20, 60).empty());
}

TEST(SpectralLines, NoiseAndSilenceHaveNone) {
  EXPECT_TRUE(spectral_lines(runs_with({}, 0), kPeriods, 1, 60).empty());
  EXPECT_TRUE(spectral_lines({Eigen::MatrixXf::Zero(8000, 2)}, {kPeriod}, 1, 60).empty());
}

// The second run as a slower recorder would hold it: every third row.
TEST(SpectralLines, AddUpOverRunsOfDifferentPeriod) {
  std::vector<Eigen::MatrixXf> runs = runs_with({17.31}, 0.2);
  const Eigen::MatrixXf fast = runs[1];
  runs[1] = Eigen::MatrixXf(fast.rows() / 3, fast.cols());
  for (Eigen::Index k = 0; k < runs[1].rows(); ++k) runs[1].row(k) = fast.row(3 * k);
  const auto lines = spectral_lines(runs, {kPeriod, 3 * kPeriod}, 1, 60);
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_NEAR(lines[0], 17.31, 0.25 / 8);
  EXPECT_EQ(spectral_lines({runs[1]}, {3 * kPeriod}, 1, 400).size(), 1u);  // above 167 Hz there is nothing to see
}

TEST(SpectralLines, NarrowOnlyCandidatesWithAFrequency) {
  Candidate ripple;
  ripple.effect.effect = "ripple";
  ripple.effect.port = "source.p";
  ripple.effect.parameters = {0, 0, 0};
  ripple.bounds = {{1, 10}, {1, 60}, {0, 0}};
  Candidate offset;
  offset.effect.effect = "offset";
  offset.effect.port = "sensor.p";
  offset.effect.parameters = {0};
  offset.bounds = {{-1, 1}};
  const auto all = at_lines({offset, ripple}, runs_with({17.31, 41.07}, 0.5), kPeriods);
  ASSERT_GE(all.size(), 3u);
  EXPECT_EQ(all[0].effect.effect, "offset");
  EXPECT_EQ(all[0].bounds[0].maximum, 1);
  EXPECT_EQ(all[1].bounds[0].maximum, 10);
  for (std::size_t i = 1; i < all.size(); ++i)
    EXPECT_LE(all[i].bounds[1].maximum - all[i].bounds[1].minimum, 1.001 / 8);
  EXPECT_EQ(at_lines({offset, ripple}, runs_with({}, 0), kPeriods).size(), 1u);
}

}  // namespace
}  // namespace faultline
