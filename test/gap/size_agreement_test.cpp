// An effect that the rig has is as large in every part of the runs; one that grows is no cause.
#include "faultline/gap/size_agreement.h"

#include <gtest/gtest.h>

#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

constexpr double kFitted = 3e-9;

Candidate leak() {
  for (const Candidate& candidate : candidates(servo(), {}))
    if (candidate.effect.effect == "orifice_leakage" && candidate.effect.port == "flow.chamber_a_tank") {
      Candidate result = candidate;
      result.effect.parameters = {kFitted};
      return result;
    }
  throw std::logic_error("the datasheet has no such leak");
}

// Of a leak of kFitted, in runs of rigs that have these.
SizeAgreement agreement(const std::vector<double>& leaks) {
  std::vector<SegmentedRun> runs;
  std::vector<std::size_t> all;
  for (const double coefficient : leaks) {
    SimulationSetup setup = servo_setup("multisine", 3 + runs.size());
    setup.parameters = servo().nominal();
    EffectSpec effect = leak().effect;
    effect.parameters = {coefficient};
    setup.effects.push_back(effect);
    all.push_back(runs.size());
    runs.push_back(cut_run(servo(), "run", simulate(servo(), setup, 6), 0.25));
  }
  ResidualModel residuals(servo(), runs);
  FitResult at;
  at.effects = {leak()};
  at.model = with_effects(at.effects, servo().nominal());
  const Linearisation linear(residuals, at.model, all, 1);
  return size_agreement(residuals, at, linear, 1).front();
}

TEST(SizeAgreement, OfWhatTheRigHas) {
  const SizeAgreement same = agreement({kFitted, kFitted});
  EXPECT_GE(same.parts, 4);  // of long runs: pieces
  EXPECT_LT(same.spread, 0.05);
  EXPECT_GT(same.least, 0.9);
  EXPECT_LT(same.most, 1.1);
}

TEST(SizeAgreement, OfWhatIsAnotherInEachRun) {
  const SizeAgreement other = agreement({0.5 * kFitted, 1.5 * kFitted});
  EXPECT_GT(other.spread, 0.4);
  EXPECT_NEAR(other.least, 0.5, 0.1);
  EXPECT_NEAR(other.most, 1.5, 0.1);
}

TEST(SizeAgreement, OfASizeThatIsWrongEverywhereAlike) {
  const SizeAgreement twice = agreement({2 * kFitted, 2 * kFitted});
  EXPECT_LT(twice.spread, 0.15);
  EXPECT_GT(twice.least, 1.5);
}

TEST(SizeAgreement, WhatHasNoSizeHasNoParts) {
  std::vector<SegmentedRun> runs = {cut_run(servo(), "run", simulate(servo(), servo_setup("multisine", 3), 4), 0.25)};
  ResidualModel residuals(servo(), runs);
  FitResult at;
  Candidate stuck;
  stuck.effect = parse_effect("stuck@sensor.position:from=100");
  stuck.bounds = {{100, 100}};
  at.effects = {stuck};
  at.model = with_effects(at.effects, servo().nominal());
  const Linearisation linear(residuals, at.model, {0}, 1);
  EXPECT_EQ(size_agreement(residuals, at, linear, 1).front().parts, 0);
}

}  // namespace
}  // namespace faultline
