// Which courses explain a missing signal: none that does harm on runs that its fit did not see.
#include "faultline/gap/signal_regression.h"

#include <gtest/gtest.h>

#include <cmath>

#include "faultline/gap/gap_trials.h"

namespace faultline {
namespace {

const std::vector<Fold> kFolds = {{{0}, {1}}, {{1}, {0}}};

// Two runs, two courses: what the readings of each run say of each course.
SignalRegression regression(const Eigen::Vector2d& first, const Eigen::Vector2d& second) {
  std::vector<SignalEquations> parts(2);
  for (std::size_t run = 0; run < 2; ++run) {
    parts[run].run = run;
    parts[run].a = 100 * Eigen::Matrix2d::Identity();
    parts[run].b = run == 0 ? first : second;
  }
  return SignalRegression(parts, kFolds);
}

TEST(SignalRegression, TakesWhatHelpsOnOtherRuns) {
  EXPECT_EQ(regression({100, 0}, {90, 1}).select({0, 1}, 2), SignalRegression::Columns{0});
  EXPECT_EQ(regression({0, 100}, {1, 90}).select({0, 1}, 2), SignalRegression::Columns{1});
}

TEST(SignalRegression, TakesNothingWhereEveryCourseDoesHarm) {
  EXPECT_TRUE(regression({100, 50}, {-90, -60}).select({0, 1}, 2).empty());
  EXPECT_TRUE(regression({100, 50}, {-90, -60}).select({}, 2).empty());
  EXPECT_TRUE(regression({NAN, NAN}, {NAN, NAN}).select({0, 1}, 2).empty());
}

}  // namespace
}  // namespace faultline
