// The stage `fault_response`: its ranking before and after a leak opens, its times, and that a sample without a
// judgement costs nothing.
#include <gtest/gtest.h>

#include "allocations.h"
#include "faultline/estimators/estimator_stage.h"
#include "faultline/estimators/response_core.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

constexpr double kOnset = 6.6;  // s
constexpr double kLeak = 1.5e-8;

const StageSpec& responses() { return servo().estimators[servo().estimator("responses")]; }

struct Told {
  double time;
  std::shared_ptr<const Ranking> ranking;
};

TEST(ResponseStage, RanksTheLeakOnceItIsThere) {
  SimulationSetup setup = off_nominal("random", 4);
  setup.effects.push_back(parse_effect("orifice_leakage@flow.chamber_a_chamber_b:coefficient=1.5e-8,from=6.6"));
  Simulator simulator(servo(), setup);
  EstimatorStage stage(servo(), responses());
  Estimate estimate;
  std::vector<Told> told;
  std::uint64_t silent = 0, between = 0;  // allocations of samples without news; the same while no stretch is collected
  for (int k = 0; k <= 13000; ++k) {
    const Sample& sample = simulator.step();
    const std::uint64_t before = allocations();
    ASSERT_TRUE(stage.process(sample, estimate));
    const std::uint64_t taken = allocations() - before;
    ASSERT_EQ(estimate.time, sample.time);
    ASSERT_EQ(estimate.sequence, sample.sequence);
    ASSERT_EQ(estimate.restarted, k == 0);
    ASSERT_EQ(estimate.channel_status.size(), servo().channels.size());
    ASSERT_TRUE(estimate.ranking);
    const bool changed = told.empty() || told.back().ranking != estimate.ranking;
    ASSERT_EQ(stage.news(), changed) << sample.time;
    if (changed) told.push_back({sample.time, estimate.ranking});
    if (changed || k == 0) continue;
    silent += taken;
    if (k % 2000 > 600) between += taken;
  }
  EXPECT_EQ(between, 0u);
  EXPECT_LT(silent,
            8 * 30u);  // a stretch's rows, and one's between, reserved at its beginning, and the thread that judges
  EXPECT_TRUE(estimate.quantities.empty());
  EXPECT_TRUE(estimate.state.empty());

  // Nothing is judged at the start; then a stretch of 0.5 s in each 2 s, told 1 s after its end.
  ASSERT_EQ(told.size(), 7u);
  EXPECT_TRUE(told[0].ranking->first.empty());
  for (std::size_t i = 1; i < told.size(); ++i) {
    const Ranking& ranking = *told[i].ranking;
    EXPECT_EQ(ranking.threshold, 15);
    EXPECT_NEAR(told[i].time - ranking.judged_until, 1, 2e-3);
    EXPECT_NEAR(ranking.judged_until, 2 * (static_cast<double>(i) - 1) + 0.5, 5e-3);
    EXPECT_EQ(ranking.first.empty(), ranking.judged_until < kOnset) << told[i].time;
    if (ranking.first.empty()) {
      EXPECT_LT(ranking.evidence, ranking.threshold);
      continue;
    }
    const RankedHypothesis& best = ranking.first.front();
    EXPECT_EQ(best.name(), "orifice_leakage@flow.chamber_a_chamber_b");
    EXPECT_EQ(best.kind, AlarmKind::fault);
    EXPECT_EQ(best.size_name, "coefficient");
    EXPECT_EQ(best.size_unit, "m^3/(s sqrt(Pa))");
    EXPECT_GT(best.evidence, ranking.threshold);
    EXPECT_EQ(ranking.evidence, best.evidence);
    EXPECT_NEAR(best.size(), kLeak, 0.2 * kLeak);
    EXPECT_LT(best.sizes(best.std).low, kLeak);
    EXPECT_GT(best.sizes(best.std).high, kLeak);
    EXPECT_NEAR(ranking.since, 8, 0.01);  // the beginning of the first stretch that shows it
    for (std::size_t k = 1; k < ranking.first.size(); ++k)
      EXPECT_GE(ranking.first[k - 1].evidence, ranking.first[k].evidence);
  }
}

TEST(ResponseStage, IsolabilityAsksWithTheSettingsOfTheStage) {
  const ResponseSettings given = response_settings(servo());
  EXPECT_EQ(given.threshold_evidence, 15);
  EXPECT_EQ(given.segment_s, 0.1);
  EXPECT_EQ(response_settings(servo_filter()).threshold_evidence, ResponseSettings().threshold_evidence);
}

}  // namespace
}  // namespace faultline
