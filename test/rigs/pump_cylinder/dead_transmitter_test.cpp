// A transmitter without supply reads zero with its noise. The datasheet has a scale of 0 for that, so it is not stuck.
#include <gtest/gtest.h>

#include "faultline/estimators/fault_responses.h"
#include "faultline/estimators/stretch_collector.h"
#include "rigs/pump_cylinder/runs.h"

namespace faultline {
namespace {

TEST(DeadTransmitter, IsItsScaleAndNotStuck) {
  SimulationSetup setup = cylinder_off_nominal("multisine", 5);
  setup.effects.push_back(parse_effect("scale@sensor.chamber_a_pressure:factor=0,from=15"));
  const Recording run = simulate(cylinder(), setup, 22);
  const std::size_t stage = cylinder().estimator("responses");
  const ResponseSettings settings = read_response_settings(cylinder().estimators[stage].settings, cylinder());
  StretchCollector collector(cylinder(), settings);
  FaultResponses responses(cylinder(), settings);
  for (std::size_t k = 0; k < run.rows(); ++k)
    if (const auto stretch = collector.add(run.time[k], run.row(k), true)) responses.judge(*stretch);
  ASSERT_FALSE(responses.first().empty());
  EXPECT_EQ(responses.hypotheses()[responses.first().front().hypothesis].name(), "scale@sensor.chamber_a_pressure");
  EXPECT_EQ(responses.doubt(), "");
}

}  // namespace
}  // namespace faultline
