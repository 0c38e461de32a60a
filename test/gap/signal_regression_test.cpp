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
  EXPECT_EQ(regression({100, 0}, {90, 1}).select({{0}, {1}}, 2), SignalRegression::Columns{0});
  EXPECT_EQ(regression({0, 100}, {1, 90}).select({{0}, {1}}, 2), SignalRegression::Columns{1});
}

TEST(SignalRegression, TakesNothingWhereEveryCourseDoesHarm) {
  EXPECT_TRUE(regression({100, 50}, {-90, -60}).select({{0}, {1}}, 2).empty());
  EXPECT_TRUE(regression({100, 50}, {-90, -60}).select({}, 2).empty());
  EXPECT_TRUE(regression({NAN, NAN}, {NAN, NAN}).select({{0}, {1}}, 2).empty());
}

// x^3 beside a spring that was refitted: what is missing is the difference of two courses that are much alike.
TEST(SignalRegression, TakesTwoTogetherThatAloneSayNothing) {
  std::vector<SignalEquations> parts(2);
  const double shift[] = {0.002, -0.002};
  for (std::size_t run = 0; run < 2; ++run) {
    parts[run].run = run;
    parts[run].a = 1e6 * (Eigen::Matrix2d() << 1, 0.999, 0.999, 1).finished();
    parts[run].b = parts[run].a * Eigen::Vector2d(-1 + shift[run], 1 + shift[run]);
  }
  const SignalRegression regression(parts, kFolds);
  EXPECT_TRUE(regression.select({{0}, {1}}, 2).empty());
  EXPECT_EQ(regression.select({{0}, {1}, {0, 1}}, 2), (SignalRegression::Columns{0, 1}));
  EXPECT_TRUE(regression.select({{0}, {1}, {0, 1}}, 1).empty());  // as many as are allowed
}

// What came first, and says nothing more beside what came after it.
TEST(SignalRegression, LeavesOutWhatAddsLittle) {
  std::vector<SignalEquations> parts(2);
  for (std::size_t run = 0; run < 2; ++run) {
    parts[run].run = run;
    // The third is nearly the sum of the two that make the signal up.
    parts[run].a = 1e4 * (Eigen::Matrix3d() << 1, 0, 0.7, 0, 1, 0.7, 0.7, 0.7, 1).finished();
    parts[run].b = parts[run].a * Eigen::Vector3d(1, 1, 0);
  }
  EXPECT_EQ(SignalRegression(parts, kFolds).select({{0}, {1}, {2}}, 3), SignalRegression::Columns{2});
  EXPECT_EQ(SignalRegression(parts, kFolds).select({{0}, {2}, {0, 1}}, 3), SignalRegression::Columns{2});
}

}  // namespace
}  // namespace faultline
