// Whether what was found is told: by stretches after it, or by very much evidence at once.
#include "faultline/estimators/confirmation.h"

#include <gtest/gtest.h>

namespace faultline {
namespace {

TEST(Confirmation, ComesFromStretchesAfterTheOnesThatFoundIt) {
  const ResponseSettings settings;
  Confirmation confirmation(settings);
  confirmation.found(0.99 * settings.sure_ratio * settings.threshold_evidence);
  EXPECT_FALSE(confirmation.given());
  confirmation.hear(0.6 * settings.threshold_evidence);
  EXPECT_FALSE(confirmation.given());
  confirmation.hear(0.6 * settings.threshold_evidence);  // of the first two thirds are left
  EXPECT_TRUE(confirmation.given());
  confirmation.hear(-10 * settings.threshold_evidence);  // whether it is over is another question
  EXPECT_TRUE(confirmation.given());
  confirmation.withdraw();
  EXPECT_FALSE(confirmation.given());
  confirmation.found(settings.sure_ratio * settings.threshold_evidence);
  EXPECT_TRUE(confirmation.given());
}

// A third of a threshold in every stretch is what a model gets wrong everywhere: it comes near and never there.
TEST(Confirmation, DoesNotComeFromALittleForEver) {
  const ResponseSettings settings;
  Confirmation confirmation(settings);
  const double little = 0.999 * settings.threshold_evidence / static_cast<double>(settings.recent_stretches);
  for (int i = 0; i < 1000; ++i) confirmation.hear(little);
  EXPECT_FALSE(confirmation.given());
}

}  // namespace
}  // namespace faultline
