// How large a leak is: the responses of the model look at it beside parameters that many a leak resembles, so that the
// size hangs on what the stretches before the leak have said of these.
#include <gtest/gtest.h>

#include "faultline/estimators/fault_responses.h"
#include "faultline/estimators/stretch_collector.h"
#include "rigs/pump_cylinder/runs.h"

namespace faultline {
namespace {

TEST(Leak, SizeStaysWhenAllRecentStretchesShowIt) {
  const double truth = 1.5e-13;
  const std::string place = "laminar_leakage@flow.pump2_b_tank";
  SimulationSetup setup = cylinder_off_nominal("steps", 502);
  setup.effects.push_back(parse_effect(place + ":coefficient=1.5e-13,from=6"));
  const Recording run = simulate(cylinder(), setup, 16.5);
  for (const StageSpec& stage : cylinder().estimators) {
    if (stage.type != "fault_response") continue;
    const ResponseSettings settings = read_response_settings(stage.settings, cylinder());
    ASSERT_EQ(settings.recent_stretches, 3U);
    StretchCollector collector(cylinder(), settings);
    FaultResponses responses(cylinder(), settings);
    std::vector<double> sizes, evidence;
    for (std::size_t k = 0; k < run.rows(); ++k) {
      const auto stretch = collector.add(run.time[k], run.row(k), true);
      if (!stretch) continue;
      responses.judge(*stretch);
      if (run.time[k] < 6) continue;
      ASSERT_FALSE(responses.first().empty()) << run.time[k];
      for (const RankedFault& fault : responses.first())
        if (responses.hypotheses()[fault.hypothesis].name() == place) {
          sizes.push_back(responses.hypotheses()[fault.hypothesis].size(fault.amplitude));
          evidence.push_back(fault.evidence);
        }
    }
    // The stretches from 6, 9, 12 and 15 s on; from the third on nothing recent is without the leak.
    ASSERT_EQ(sizes.size(), 4U);
    for (const double size : sizes) EXPECT_NEAR(size, truth, 0.2 * truth);
    EXPECT_GT(evidence[2], evidence[1]);
  }
}

}  // namespace
}  // namespace faultline
