// When a model that no cause explains has lost the rig: stretches in a row that leave more than those before, until one
// is as usual.
#include "faultline/estimators/lost_model.h"

#include <gtest/gtest.h>

namespace faultline {
namespace {

constexpr double kUsual = 50;  // what the model leaves when all is well

// As much beyond what is known as it leaves more than usually.
void hear(LostModel& lost, double begin, double more) { lost.hear(begin, more, kUsual + more); }

LostModel learnt(const ResponseSettings& settings) {
  LostModel lost(settings);
  for (int k = -3; k < 0; ++k) hear(lost, k, 0);
  return lost;
}

TEST(LostModel, TakesStretchesInARow) {
  const ResponseSettings settings;
  const double strange = 1.1 * settings.lost_fraction * settings.threshold_evidence;
  LostModel lost = learnt(settings);
  for (std::size_t k = 1; k < settings.lost_stretches; ++k) hear(lost, static_cast<double>(k), strange);
  EXPECT_FALSE(lost.lost());
  EXPECT_EQ(lost.least(), 0);
  hear(lost, 10, 0.5 * strange);  // a motion that was new
  for (std::size_t k = 1; k < settings.lost_stretches; ++k) hear(lost, 10 + static_cast<double>(k), strange);
  EXPECT_FALSE(lost.lost());
  hear(lost, 20, strange);
  ASSERT_TRUE(lost.lost());
  EXPECT_EQ(lost.since(), 11);
  EXPECT_GT(lost.evidence(), settings.threshold_evidence);
  EXPECT_NEAR(lost.least(), 0.5 * strange * static_cast<double>(settings.lost_stretches), 1e-9);
}

// What it does not see well in one motion does not make it known.
TEST(LostModel, StaysUntilAStretchIsAsUsual) {
  const ResponseSettings settings;
  const double threshold = settings.threshold_evidence;
  LostModel lost = learnt(settings);
  for (std::size_t k = 0; k < settings.lost_stretches; ++k) hear(lost, static_cast<double>(k), threshold);
  hear(lost, 30, 1.1 * settings.new_fraction * threshold);
  EXPECT_TRUE(lost.lost());
  EXPECT_EQ(lost.since(), 0);
  hear(lost, 31, 0.9 * settings.new_fraction * threshold);
  EXPECT_FALSE(lost.lost());
}

// One that is always wrong by as much has lost nothing, however far beyond what is known that is.
TEST(LostModel, AModelThatIsAlwaysWrongByAsMuchHasLostNothing) {
  const ResponseSettings settings;
  LostModel lost = learnt(settings);
  for (std::size_t k = 0; k < 5 * settings.lost_stretches; ++k) lost.hear(static_cast<double>(k), 1000, kUsual);
  EXPECT_FALSE(lost.lost());
  LostModel first(settings);  // nothing was heard before
  for (std::size_t k = 0; k < 5 * settings.lost_stretches; ++k) first.hear(static_cast<double>(k), 1000, 1000);
  EXPECT_FALSE(first.lost());
}

TEST(LostModel, AStretchThatNeedsNoCloseLookGoesOnWhereItIsLostOnly) {
  const ResponseSettings settings;
  const double threshold = settings.threshold_evidence;
  LostModel lost = learnt(settings);
  for (std::size_t k = 0; k < 5 * settings.lost_stretches; ++k) lost.pass(threshold);
  EXPECT_FALSE(lost.lost());
  for (std::size_t k = 0; k < settings.lost_stretches; ++k) hear(lost, static_cast<double>(k), threshold);
  const double least = lost.least();
  lost.pass(1.1 * settings.new_fraction * threshold);
  EXPECT_TRUE(lost.lost());
  EXPECT_NEAR(lost.least(), least, 1e-9);
  lost.pass(0.9 * settings.new_fraction * threshold);
  EXPECT_FALSE(lost.lost());
}

}  // namespace
}  // namespace faultline
