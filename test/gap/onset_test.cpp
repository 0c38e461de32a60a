// Since when: a cause that begins during a run is dated and named; one that was there all the time gets no date, nor do
// runs that differ.
#include "faultline/gap/onset.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>

#include "faultline/gap/diagnose_gap.h"
#include "faultline/gap/diagnose_since.h"
#include "faultline/segments/segment_length.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

constexpr double kFrom = 4.5, kDuration = 10;

SegmentedRun servo_run(const std::string& leak, std::uint64_t seed) {
  SimulationSetup setup = servo_setup("multisine");
  setup.seed = seed;
  setup.parameters = draw_parameters(servo(), 5);
  for (const std::string& text : servo().nuisance) setup.effects.push_back(parse_effect(text));
  if (!leak.empty()) setup.effects.push_back(parse_effect("laminar_leakage@flow.chamber_a_chamber_b:" + leak));
  return cut_run(servo(), "run", simulate(servo(), setup, kDuration), segment_length(servo()));
}

const SegmentedRun& leaks_later() {
  static const SegmentedRun run = servo_run("coefficient=2e-11,from=4.5", 1);
  return run;
}

// Candidates that are left out where a few are enough.
std::vector<std::string> all_but(const std::set<std::string>& effects) {
  std::vector<std::string> result;
  for (const Port& port : servo().ports)
    for (const FittingEffect& fitting : port.effects)
      if (effects.count(fitting.effect) == 0) result.push_back(fitting.effect + "@" + port.name);
  return result;
}

GapSettings few_candidates() {
  GapSettings settings;
  settings.jobs = 2;
  settings.most_effects = 1;
  settings.without = all_but({"laminar_leakage", "coulomb_friction", "offset", "stuck"});
  return settings;
}

OnsetSearch search_of(std::vector<SegmentedRun> runs) { return {servo(), std::move(runs), GapOptions(), 2}; }

TEST(Onset, OfALeakIsFoundToASegment) {
  OnsetSearch search = search_of({leaks_later()});
  const std::optional<Onset> onset = search.find();
  ASSERT_TRUE(onset);
  ASSERT_EQ(onset->moments.size(), 1u);
  EXPECT_EQ(onset->moments[0].run, 0u);
  EXPECT_NEAR(onset->moments[0].time, kFrom, 1.01 * segment_length(servo()));
  // What follows is explained by the leak, which before was not there; and by what cannot show before.
  const std::string leak = "laminar_leakage@flow.chamber_a_chamber_b:coefficient=2e-11";
  EXPECT_GT(search.contradicted(*onset, {parse_effect(leak)}), 0.5);
  EXPECT_LT(search.contradicted(*onset, {parse_effect(leak + ",from=4.5")}), 0.02);
  // As a rig of its own.
  const GapOptions::Onset options;
  const Datasheet before = calibrated(servo(), *onset, options);
  const auto left = [&](const char* name) {
    const auto i = static_cast<std::size_t>(servo().parameter(name));
    EXPECT_EQ(before.parameters[i].nominal, onset->parameters[i]);
    return before.parameters[i].tolerance / servo().parameters[i].tolerance;
  };
  for (const char* told : {"ram_area", "viscous_damping", "flow_coefficient"})
    EXPECT_DOUBLE_EQ(left(told), options.tolerance_fraction) << told;
  EXPECT_DOUBLE_EQ(left("leak_valve_gain"), 1);  // that valve stays shut
  const SegmentedRun rest = rest_of(servo(), leaks_later(), onset->segments[0], GapOptions().segments);
  EXPECT_NEAR(rest.duration(), kDuration - onset->moments[0].time, 0.01);
}

// Whatever parameters of before leave later: those of all runs may explain both, as of a rig that stands idle first.
TEST(Onset, IsNoneWhereParametersOfAllRunsExplainBoth) {
  std::string remark;
  EXPECT_FALSE(diagnose_since(servo(), {leaks_later()}, {}, few_candidates(), {}, 0, remark));
  EXPECT_EQ(remark, "");
}

TEST(Onset, IsNoneWhereNothingBegins) {
  EXPECT_FALSE(search_of({servo_run("", 1)}).find());
  EXPECT_FALSE(search_of({servo_run("coefficient=2e-11", 1)}).find());
}

// A healthy run beside one that has it from its beginning on.
TEST(Onset, LiesBetweenRuns) {
  const std::optional<Onset> onset = search_of({servo_run("coefficient=2e-11", 2), servo_run("", 1)}).find();
  ASSERT_TRUE(onset);
  EXPECT_EQ(onset->segments, (std::vector<std::size_t>{0, 40}));
  ASSERT_EQ(onset->moments.size(), 1u);
  EXPECT_EQ(onset->moments[0].run, 0u);
  EXPECT_EQ(onset->moments[0].time, 0);
}

TEST(Onset, IsFoundInALaterRun) {
  const std::optional<Onset> onset = search_of({servo_run("", 2), leaks_later()}).find();
  ASSERT_TRUE(onset);
  ASSERT_EQ(onset->moments.size(), 1u);
  EXPECT_EQ(onset->segments[0], 40u);
  EXPECT_EQ(onset->moments[0].run, 1u);
  EXPECT_NEAR(onset->moments[0].time, kFrom, 1.01 * segment_length(servo()));
}

// A fault that is put in during each of several runs, at the same time or not.
TEST(Onset, IsFoundInEachRun) {
  for (const char* second : {"coefficient=2e-11,from=4.5", "coefficient=2e-11,from=7"}) {
    const std::optional<Onset> onset = search_of({leaks_later(), servo_run(second, 2), servo_run("", 3)}).find();
    ASSERT_TRUE(onset) << second;
    ASSERT_EQ(onset->moments.size(), 2u) << second;
    EXPECT_EQ(onset->moments[0].run, 0u);
    EXPECT_EQ(onset->moments[1].run, 1u);
    EXPECT_NEAR(onset->moments[0].time, kFrom, 1.01 * segment_length(servo()));
    EXPECT_NEAR(onset->moments[1].time, std::stod(std::string(second).substr(23)), 1.01 * segment_length(servo()));
    EXPECT_EQ(onset->segments[2], 40u);
  }
}

TEST(Onset, IsToldWithTheName) {
  GapSettings settings;
  settings.jobs = 2;
  settings.most_effects = 1;
  double last = 0;
  const GapResult result = diagnose_gap(servo(), {leaks_later()}, {}, settings, [&](double done, const std::string&) {
    EXPECT_GE(done, last);
    last = done;
  });
  EXPECT_EQ(result.verdict, "named") << result.sentence;
  ASSERT_EQ(result.effects.size(), 1u);
  EXPECT_EQ(result.effects.front().effect, "laminar_leakage");
  EXPECT_EQ(result.effects.front().port, "flow.chamber_a_chamber_b");
  EXPECT_NEAR(result.effects.front().parameters.at("coefficient"), 2e-11, 0.3e-11);
  ASSERT_TRUE(result.since);
  ASSERT_EQ(result.since->moments.size(), 1u);
  EXPECT_EQ(result.since->moments[0].run, 0u);
  EXPECT_NEAR(result.since->moments[0].time, kFrom, 1.01 * result.since->within);
  EXPECT_EQ(result.runs, std::vector<std::string>{"run"});
  EXPECT_NE(result.sentence.find("Since 4.5 s of run"), std::string::npos) << result.sentence;
  EXPECT_GE(result.series.time.front(), result.since->moments[0].time - 1e-9);
}

TEST(Onset, OfRunsHeldOutIsToldToo) {
  const GapSettings settings = few_candidates();
  SegmentedRun held_out = servo_run("coefficient=2e-11,from=7", 2);
  held_out.name = "other";
  const GapResult result = diagnose_gap(servo(), {leaks_later()}, {held_out}, settings, nullptr);
  EXPECT_EQ(result.verdict, "named") << result.sentence;
  ASSERT_EQ(result.effects.size(), 1u);
  EXPECT_EQ(result.effects.front().effect, "laminar_leakage");
  ASSERT_TRUE(result.since);
  ASSERT_EQ(result.since->moments.size(), 2u);
  EXPECT_EQ(result.since->moments[1].run, 1u);
  EXPECT_NEAR(result.since->moments[1].time, 7, 1.01 * result.since->within);
  EXPECT_EQ(result.holdout, std::vector<std::string>{"other"});
  EXPECT_NE(result.sentence.find("s of other"), std::string::npos) << result.sentence;
}

// What nobody can name began all the same.
TEST(Onset, OfWhatIsUnknownIsARemark) {
  GapSettings settings = few_candidates();
  settings.most_effects = 0;
  const GapResult result = diagnose_gap(servo(), {leaks_later()}, {}, settings, nullptr);
  EXPECT_EQ(result.verdict, "unknown") << result.sentence;
  EXPECT_FALSE(result.since);
  const auto said = [](const std::string& remark) { return remark.rfind("until 4.5 s of run the model", 0) == 0; };
  EXPECT_TRUE(std::any_of(result.remarks.begin(), result.remarks.end(), said));
}

TEST(Onset, OfOneRunOfTwoIsTold) {
  const GapSettings settings = few_candidates();
  SegmentedRun healthy = servo_run("", 1), leaks = servo_run("coefficient=2e-11", 2);
  healthy.name = "healthy";
  leaks.name = "leaks";
  const GapResult result = diagnose_gap(servo(), {healthy, leaks}, {}, settings, nullptr);
  EXPECT_EQ(result.verdict, "named") << result.sentence;
  ASSERT_EQ(result.effects.size(), 1u);
  EXPECT_EQ(result.effects.front().effect, "laminar_leakage");
  EXPECT_NEAR(result.effects.front().parameters.at("coefficient"), 2e-11, 0.3e-11);
  ASSERT_TRUE(result.since);
  EXPECT_EQ(result.runs[result.since->moments[0].run], "leaks");
  EXPECT_NE(result.sentence.find("It is in leaks"), std::string::npos) << result.sentence;
}

// What sticks has a time of its own, and it is the run's.
TEST(Onset, OfAStuckTransducerIsATimeOfTheRun) {
  const GapSettings settings = few_candidates();
  SimulationSetup setup = servo_setup("multisine");
  setup.effects = {parse_effect("stuck@sensor.load_pressure:from=6.2")};
  const SegmentedRun run = cut_run(servo(), "run", simulate(servo(), setup, kDuration), segment_length(servo()));
  const GapResult result = diagnose_gap(servo(), {run}, {}, settings, nullptr);
  EXPECT_EQ(result.verdict, "named") << result.sentence;
  ASSERT_FALSE(result.effects.empty());
  EXPECT_EQ(result.effects.front().effect, "stuck");
  EXPECT_NEAR(result.effects.front().parameters.at("from"), 6.2, 0.3);
}

}  // namespace
}  // namespace faultline
