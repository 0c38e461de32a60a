// An axis as benchmarks have them: dry friction beside a load, a fine encoder alone, and gain, mass and friction of
// which only ratios show, so that their tolerances decide.
#include <gtest/gtest.h>

#include <map>

#include "axis.h"
#include "faultline/gap/diagnose_gap.h"

namespace faultline {
namespace {

TEST(Axis, FrictionBesideALoadIsToldWithTheSizesThatTolerancesPrefer) {
  const Datasheet sheet = axis();
  std::vector<SegmentedRun> runs;
  for (const std::uint64_t seed : {1, 2})
    runs.push_back(cut_run(sheet, "run " + std::to_string(seed), axis_run(9, seed, 20, -3), 1));
  GapSettings settings;
  settings.jobs = 2;
  const GapResult result = diagnose_gap(sheet, std::move(runs), {}, settings, {});
  EXPECT_EQ(result.verdict, "named") << result.sentence;
  EXPECT_GT(result.shrink_refit, 0.99);
  std::map<std::string, const NamedEffect*> found;
  for (const NamedEffect& effect : result.effects) found[effect.effect] = &effect;
  ASSERT_EQ(found.count("coulomb_friction"), 1u) << result.sentence;
  const NamedEffect& friction = *found["coulomb_friction"];
  EXPECT_NEAR(friction.parameters.at("force"), 20, 1);
  // They leave the scale of all forces open by some percent, however fine the encoder.
  const Interval& interval = friction.intervals.at("force");
  EXPECT_LT(interval.low, 19);
  EXPECT_GT(interval.high, 21);
  // A constant force and a command that is off are the same here.
  ASSERT_EQ(found.count("load_force") + found.count("offset"), 1u) << result.sentence;
  const double load = found.count("offset") ? -35 * found["offset"]->parameters.at("value")
                                            : found["load_force"]->parameters.at("constant");
  EXPECT_NEAR(load, -3, 0.3);
}

}  // namespace
}  // namespace faultline
