// When a model that no cause explains has lost the rig: stretches in a row, until one is as usual.
#include "faultline/estimators/lost_model.h"

#include <gtest/gtest.h>

namespace faultline {
namespace {

TEST(LostModel, TakesStretchesInARow) {
  const ResponseSettings settings;
  const double strange = 1.1 * settings.lost_fraction * settings.threshold_evidence;
  LostModel lost(settings);
  for (std::size_t k = 1; k < settings.lost_stretches; ++k) lost.hear(static_cast<double>(k), strange);
  EXPECT_FALSE(lost.lost());
  EXPECT_EQ(lost.least(), 0);
  lost.hear(10, 0.5 * strange);  // a motion that was new
  for (std::size_t k = 1; k < settings.lost_stretches; ++k) lost.hear(10 + static_cast<double>(k), strange);
  EXPECT_FALSE(lost.lost());
  lost.hear(20, strange);
  ASSERT_TRUE(lost.lost());
  EXPECT_EQ(lost.since(), 11);
  EXPECT_GT(lost.evidence(), settings.threshold_evidence);
  EXPECT_NEAR(lost.least(), 0.5 * strange * static_cast<double>(settings.lost_stretches), 1e-9);
}

// What it does not see well in one motion does not make it known.
TEST(LostModel, StaysUntilAStretchIsAsUsual) {
  const ResponseSettings settings;
  const double threshold = settings.threshold_evidence;
  LostModel lost(settings);
  for (std::size_t k = 0; k < settings.lost_stretches; ++k) lost.hear(static_cast<double>(k), threshold);
  lost.hear(30, 1.1 * settings.new_fraction * threshold);
  EXPECT_TRUE(lost.lost());
  EXPECT_EQ(lost.since(), 0);
  lost.hear(31, 0.9 * settings.new_fraction * threshold);
  EXPECT_FALSE(lost.lost());
}

}  // namespace
}  // namespace faultline
