// A transmitter that drifts fast leaves the range of its offset behind; it is still a drift, and not stuck.
#include <gtest/gtest.h>

#include "faultline/alarms/diagnosis.h"
#include "rigs/pump_cylinder/runs.h"

namespace faultline {
namespace {

TEST(DriftingTransmitter, IsADriftToTheEnd) {
  SimulationSetup setup = cylinder_off_nominal("steps", 1);
  setup.effects.push_back(parse_effect("drift@sensor.chamber_a_pressure:rate=6e4,from=15"));
  const Recording run = simulate(cylinder(), setup, 60);
  Diagnosis diagnosis(cylinder());
  for (std::size_t k = 0; k < run.rows(); ++k) diagnosis.process(run.sample(k));
  const Alarm* alarm = headline(diagnosis.report());
  ASSERT_NE(alarm, nullptr);
  EXPECT_EQ(alarm->effect + "@" + alarm->port, "drift@sensor.chamber_a_pressure");
  EXPECT_NEAR(alarm->since - run.time.front(), 15, 4);
  EXPECT_GT(alarm->high, 6e4);
  EXPECT_LT(alarm->low, 6e4);
}

}  // namespace
}  // namespace faultline
