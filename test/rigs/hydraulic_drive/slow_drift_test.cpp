// A transducer that drifts slowly: each stretch is hardly worse than the one before, and what the model leaves must not
// become the usual.
#include <gtest/gtest.h>

#include "faultline/alarms/diagnosis.h"
#include "rigs/hydraulic_drive/runs.h"

namespace faultline {
namespace {

TEST(SlowDrift, DoesNotBecomeTheUsual) {
  SimulationSetup setup = drive_off_nominal("multisine", 2);
  setup.effects.push_back(parse_effect("drift@sensor.motor_pressure:rate=1.5e4,from=15"));
  const Recording run = simulate(drive(), setup, 60);
  Diagnosis diagnosis(drive());
  for (std::size_t k = 0; k < run.rows(); ++k) diagnosis.process(run.sample(k));
  const Alarm* alarm = headline(diagnosis.report());
  ASSERT_NE(alarm, nullptr);
  EXPECT_EQ(alarm->effect + "@" + alarm->port, "drift@sensor.motor_pressure");
  EXPECT_LT(alarm->raised - run.time.front(), 45);
}

}  // namespace
}  // namespace faultline
