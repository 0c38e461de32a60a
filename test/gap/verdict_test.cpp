// The verdict in words: it does not contradict what is left.
#include "faultline/gap/verdict.h"

#include <cmath>

#include <gtest/gtest.h>

#include "faultline/gap/measure.h"
#include "faultline/gap/shrink.h"

namespace faultline {
namespace {

std::string said(const std::string& verdict, const std::string& left, double size = 0.05, double factor = 1.05) {
  Datasheet sheet;
  Parameter parameter;
  parameter.name = "area";
  parameter.tolerance = 0.01;
  sheet.parameters.push_back(parameter);
  GapResult result;
  result.verdict = verdict;
  result.gap.resize(2);
  result.gap[1].parameters["area"] = factor;
  result.evidence.size = size;
  result.matters = 0.01;
  describe(sheet, result, left);
  return result.sentence;
}

struct Won {
  double effects, perfect;  // log likelihood
};

// Effects that were found and what they won, in a gap of that size and excess.
GapEvidence of_effects(const Won& won, double readings, double size, double excess) {
  GapEvidence evidence;
  evidence.found = true;
  evidence.effects = won.effects;
  evidence.perfect = won.perfect;
  evidence.readings = readings;
  evidence.size = size;
  evidence.excess = excess;
  return evidence;
}

// What restarts hide may be unlikely from sample to sample and close all, or nearly all where less than the noise is
// left.
TEST(Verdict, APlayThatClosesNineTenthsIsNamedWhereLittleIsLeft) {
  const GapOptions::Verdict options;
  GapEvidence play = of_effects({-2000, 2000}, 6000, 0.05, 6);
  play.plain = false;
  play.shrink = play.typical_shrink = 0.93;
  play.shrink_low = play.typical_shrink_low = 0.9;
  play.free_before = play.free_after = 300;
  play.left = 0.4;
  EXPECT_EQ(judge_gap(play, 0.01, options).verdict, "named");
  play.left = 1.2;
  EXPECT_EQ(judge_gap(play, 0.01, options).verdict, "unknown");
  play.shrink = 0.96;
  EXPECT_EQ(judge_gap(play, 0.01, options).verdict, "named");
}

TEST(Verdict, NothingIsSaidToFitWhereMuchIsLeft) {
  EXPECT_EQ(said("none", ""), "No gap beyond the noise and the tolerances of the datasheet.");
  EXPECT_EQ(said("none", "flow 440 times its noise"),
            "No place and no effect tells what is left: flow 440 times its noise.");
  EXPECT_EQ(said("miscalibrated", ""), "The structure fits; the parameters are off: area x 1.050.");
  EXPECT_EQ(
      said("miscalibrated", "flow 440 times its noise"),
      "The parameters are off: area x 1.050. No place and no effect tells what is left: flow 440 times its noise.");
  EXPECT_EQ(
      said("none", "flow 440 times its noise", 0.004),
      "What is left, flow 440 times its noise, is 0.004 of what the channels move, too little to matter (--matters "
      "0.01).");
  EXPECT_EQ(
      said("miscalibrated", "flow 440 times its noise", 0.05, 1.001),
      "Parameters within their tolerances explain a part. No place and no effect tells what is left: flow 440 times "
      "its noise.");
  EXPECT_EQ(said("unknown", "flow 440 times its noise"),
            "Something the library does not know, and no single place explains much of it (flow 440 times its noise); "
            "no effect of the library could be tried.");
}

// A gap that is many times the noise and what matters is not silence, though no place is known.
TEST(Verdict, AStructureThatLeavesMuchDoesNotFit) {
  GapEvidence evidence;
  evidence.perfect = 20000;
  evidence.free_before = 700;
  evidence.readings = 100000;
  evidence.size = 0.6;
  evidence.excess = 1200;
  evidence.calibrated = 20;
  const GapOptions::Verdict options;
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "unknown");
  EXPECT_FALSE(judge_gap(evidence, 0.01, options).placed);
  // Both are needed: noise hides much, and transducers that are much better than the model show little things.
  evidence.excess = 3.5;
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "miscalibrated");
  evidence.excess = 1200;
  evidence.size = 0.04;
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "miscalibrated");
  EXPECT_EQ(judge_gap(evidence, 0.005, options).verdict, "unknown");
  evidence.free_before = 8000;
  EXPECT_TRUE(judge_gap(evidence, 0.01, options).placed);
}

// What closes the gap down to what every rig has is its cause, whatever a free signal would make of the rest.
TEST(Verdict, WhatLeavesNothingIsNamed) {
  GapEvidence evidence = of_effects({400, 1000}, 10000, 1, 2);
  evidence.shrink = 0.95;
  evidence.free_after = 400;
  evidence.left = 0.04;
  evidence.quiet = 0.05;
  const GapOptions::Verdict options;
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "named");
  EXPECT_LE(judge_gap(evidence, 0.01, options).doubt, 1);
  evidence.left = 0.06;
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "unknown");
  evidence.left = 0.04;
  evidence.shrink = 0.8;
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "unknown");
}

// Next to nothing is left of a large gap, and rigs have small things that a free signal makes much of.
TEST(Verdict, WhatLeavesNextToNothingIsNamed) {
  GapEvidence evidence = of_effects({13000, 46500}, 29000, 0.05, 530);
  evidence.shrink = evidence.typical_shrink = 0.96;
  evidence.free_before = evidence.free_after = 8500;
  evidence.left = 15;
  evidence.quiet = 0.05;
  const GapOptions::Verdict options;
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "named");
  // Nine tenths are enough of what wins more than a free signal anywhere.
  evidence.typical_shrink = 0.92;
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "named");
  for (double* free : {&evidence.free_before, &evidence.free_after}) {
    *free = 13500;
    EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "unknown");
    *free = 8500;
  }
  evidence.typical_shrink = 0.9;
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "unknown");
  // A size that changes is no cause, however much it closes.
  evidence.typical_shrink = 0.96;
  evidence.spread = 0.4;
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "unknown");
}

// Less than a quarter of the noise is left: entrained air after another law of the gas.
TEST(Verdict, OfASmallGapThreeQuartersAreEnough) {
  GapEvidence evidence = of_effects({4467, 9422}, 45598, 0.022, 1.41);
  evidence.shrink = 0.84;
  evidence.typical_shrink = 0.8;
  evidence.free_before = 1469;
  evidence.free_after = 1290;
  evidence.left = 0.2;
  evidence.quiet = 0.05;
  EXPECT_EQ(judge_gap(evidence, 0.01, {}).verdict, "named");
  evidence.left = 0.3;
  EXPECT_EQ(judge_gap(evidence, 0.01, {}).verdict, "unknown");
  evidence.left = 0.2;
  evidence.typical_shrink = 0.7;
  EXPECT_EQ(judge_gap(evidence, 0.01, {}).verdict, "unknown");
}

// A perfect model is no measure of what nobody can win: two leaks in a rig whose noise has far outliers.
TEST(Verdict, WhatWinsMoreThanAFreeSignalIsToldThoughAPerfectModelWouldWinMuchMore) {
  GapEvidence evidence = of_effects({1780, 30300}, 29000, 0.18, 52);
  evidence.shrink = 0.76;
  evidence.typical_shrink = 0.81;
  evidence.free_before = 870;
  evidence.free_after = 500;
  evidence.left = 12;
  const GapOptions::Verdict options;
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "named");
  evidence.free_after = 1700;  // wins as much again: they are a part
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "unknown");
  EXPECT_TRUE(judge_gap(evidence, 0.01, options).names);
  evidence.free_before = 1800;
  EXPECT_FALSE(judge_gap(evidence, 0.01, options).names);
  evidence.free_before = 870;
  evidence.shrink = 0.45;
  EXPECT_FALSE(judge_gap(evidence, 0.01, options).names);
}

// A gap that is too small to need a cause, or smaller than the noise, has one only where that closes most of it.
TEST(Verdict, WhatClosesLittleOfASmallGapIsNoName) {
  GapEvidence evidence = of_effects({400, 1000}, 8000, 0.009, 2);
  evidence.shrink = 0.45;
  const GapOptions::Verdict options;
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "named");
  evidence.shrink = 0.35;
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "none");
  EXPECT_FALSE(judge_gap(evidence, 0.01, options).names);
  evidence.size = 0.011;  // a part of one that matters
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "unknown");
  EXPECT_TRUE(judge_gap(evidence, 0.01, options).names);
  evidence.excess = 0.2;
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "none");
}

// It is a part of the cause at most, unless what is left is of other places: of a rig with many branches, say.
TEST(Verdict, WhatLeavesMostOfALargeGapIsAPart) {
  GapEvidence evidence = of_effects({810, 5400}, 48000, 0.028, 1.8);
  evidence.shrink = 0.3;
  evidence.typical_shrink = 0.47;
  const GapOptions::Verdict options;
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "unknown");
  EXPECT_TRUE(judge_gap(evidence, 0.01, options).names);
  evidence.output_shrink = 0.8;
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "named");
  evidence.output_shrink = 0.4;
  evidence.typical_shrink = 0.54;
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "named");
}

// What has another size in each part of the runs makes up for a cause and is none.
TEST(Verdict, ASizeThatChangesIsNoCause) {
  GapEvidence evidence = of_effects({700, 1000}, 10000, 1, 2);
  evidence.shrink = 0.8;
  evidence.left = 0.4;
  evidence.spread = 0.1;
  const GapOptions::Verdict options;
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "named");
  evidence.shrink_low = -0.1;  // it rests on a single segment
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "none");
  evidence.shrink_low = 0.5;
  evidence.spread = 0.4;
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "unknown");
  EXPECT_TRUE(judge_gap(evidence, 0.01, options).names);
  // Nor is it a part of something unknown where the gap is too small to have a cause.
  evidence.effects = 900;
  EXPECT_EQ(judge_gap(evidence, 2, options).verdict, "none");
}

// What would have to be four times as large as the datasheet lets it, or more, is another cause that looks like it.
TEST(Verdict, ASizeAtTheEndOfWhatIsTriedIsNoName) {
  GapEvidence evidence = of_effects({28000, 32000}, 29000, 0.27, 39);
  evidence.shrink = evidence.typical_shrink = 0.97;
  const GapOptions::Verdict options;
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "named");
  evidence.beyond = true;
  const GapVerdict answer = judge_gap(evidence, 0.01, options);
  EXPECT_EQ(answer.verdict, "unknown");
  EXPECT_TRUE(answer.names);
  EXPECT_GT(answer.doubt, 1);
}

// Where a perfect model would win very much, a tenth of that is much in itself.
TEST(Verdict, WhatWinsMuchStandsBesideAName) {
  GapEvidence evidence = of_effects({6000, 34000}, 28800, 0.15, 126);
  evidence.shrink = evidence.typical_shrink = 0.6;
  evidence.free_after = 2000;
  EXPECT_EQ(judge_gap(evidence, 0.01, {}).verdict, "unknown");
  EXPECT_TRUE(judge_gap(evidence, 0.01, {}).names);
  evidence.free_after = 1400;  // less than a quarter of what the effects win
  EXPECT_EQ(judge_gap(evidence, 0.01, {}).verdict, "named");
  // The measured tanks: few readings, of which neither wins much.
  evidence = of_effects({129, 844}, 493, 0.26, 1093);
  evidence.shrink = 0.7;
  evidence.free_after = 60;
  EXPECT_EQ(judge_gap(evidence, 0.01, {}).verdict, "named");
}

TEST(Verdict, SaysWhereAFewSegmentsHoldTheGap) {
  GapResult result;
  result.verdict = "named";
  result.gap.resize(2);
  result.effects.resize(1);
  result.effects[0].effect = "offset";
  result.effects[0].port = "command.valve";
  result.shrink_refit = 0.78;
  result.evidence.typical_shrink = 0.79;
  describe({}, result, "");
  EXPECT_EQ(result.sentence, "offset at command.valve closes 78 % of what the refit leaves.");
  result.sentence.clear();
  result.shrink_refit = -0.01;
  describe({}, result, "");
  EXPECT_EQ(
      result.sentence,
      "offset at command.valve closes 79 % of what the refit leaves in a typical segment; most of the gap is in a "
      "few segments, in which something else is missing.");
}

// What is rounded is told whatever the verdict, and closes nothing.
TEST(Verdict, TellsAGridBesideWhatCloses) {
  GapResult result;
  result.gap.resize(2);
  result.effects.resize(2);
  result.effects[0].effect = "coulomb_friction";
  result.effects[0].port = "force.shaft";
  result.effects[1].effect = "quantisation";
  result.effects[1].port = "sensor.shaft_speed";
  result.shrink_refit = 0.12;
  const std::string grid = " quantisation at sensor.shaft_speed: it is in the noise, which no model closes.";
  result.verdict = "unknown";
  describe({}, result, "");
  EXPECT_EQ(result.sentence,
            "Something the library does not know; the nearest, coulomb_friction at force.shaft, closes 12 % of what "
            "the refit leaves." +
                grid);
  result.verdict = "named";
  describe({}, result, "");
  EXPECT_EQ(result.sentence, "coulomb_friction at force.shaft closes 12 % of what the refit leaves." + grid);
}

// A few segments in which the model goes astray hold the mean: a typical one decides.
TEST(Verdict, WhatClosesATypicalSegmentIsNamed) {
  GapEvidence evidence = of_effects({1045, 1045}, 8000, 0.034, 416);
  evidence.shrink = -0.01;
  evidence.shrink_low = -0.03;
  evidence.typical_shrink = 0.79;
  evidence.typical_shrink_low = 0.6;
  evidence.free_before = 508;
  evidence.free_after = 133;
  const GapOptions::Verdict options;
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "named");
  evidence.typical_shrink_low = -0.1;  // it rests on a few segments itself
  EXPECT_NE(judge_gap(evidence, 0.01, options).verdict, "named");
}

// A transducer's lag that is worth much from sample to sample and closes nothing over segments: no place is left.
TEST(Verdict, WhatImmaterialEffectsTakeIsNoPlace) {
  GapEvidence evidence = of_effects({4200, 4200}, 8000, 0.022, 9);
  evidence.shrink = 0.02;
  evidence.free_before = 1240;
  evidence.free_after = 4;
  evidence.calibrated = 100;
  const GapOptions::Verdict options;
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "miscalibrated");
  evidence.free_after = 1200;  // it takes none of it
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "unknown");
  EXPECT_TRUE(judge_gap(evidence, 0.01, options).placed);
}

// A place is spoken of where its signal wins a tenth of the whole: less is a part that no place explains.
TEST(Verdict, WhatNoPlaceExplainsWithdrawsNoName) {
  GapEvidence evidence = of_effects({135, 700}, 2048, 0.3, 1500);
  evidence.shrink = 0.6;
  evidence.free_before = 18;
  evidence.left = 900;
  const GapOptions::Verdict options;
  evidence.free_after = 60;
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "named");
  // A signal that wins more is a cause beside it. The effect stays a part of it, for the gap is too large for silence.
  evidence.free_after = 80;
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "unknown");
  EXPECT_TRUE(judge_gap(evidence, 0.01, options).names);
  // What matters is for the user to say; a tenth of it is silence.
  evidence.free_after = 60;
  EXPECT_EQ(judge_gap(evidence, 2, options).verdict, "named");
  EXPECT_EQ(judge_gap(evidence, 4, options).verdict, "none");
  evidence.free_after = 80;
  evidence.size = 0.005;
  EXPECT_EQ(judge_gap(evidence, 0.01, options).verdict, "none");
  EXPECT_FALSE(judge_gap(evidence, 0.01, options).names);
}

ChannelGap gap_of(const std::string& unit, double noise, double rms, double moves) {
  ChannelGap gap;
  gap.unit = unit;
  gap.noise_std = noise;
  gap.rms["segment"] = rms;
  gap.nrmse["segment"] = rms / moves;
  return gap;
}

// Water that flows in has a temperature of its own, which nothing that the rig does moves.
TEST(Verdict, WhatAStillChannelDoesIsHeldAgainstOneThatMoves) {
  GapLevel level;
  level.channels = {gap_of("K", 0.05, 0.07, 0.08), gap_of("K", 0.05, 0.05, 10), gap_of("Pa", 500, 500, 1e6)};
  const double beyond = std::sqrt(0.07 * 0.07 - 0.05 * 0.05);
  EXPECT_NEAR(gap_size(level), beyond / 10 / std::sqrt(3), 1e-9);
  level.channels[0] = gap_of("K", 0.05, 0.07, 0.2);  // it moves
  EXPECT_NEAR(gap_size(level), beyond / 0.2 / std::sqrt(3), 1e-9);
  level.channels[0] = gap_of("m", 0.05, 0.07, 0.08);  // nothing else is like it
  EXPECT_NEAR(gap_size(level), beyond / 0.08 / std::sqrt(3), 1e-9);
}

}  // namespace
}  // namespace faultline
