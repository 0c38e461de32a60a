// Segments of rigs that no recording shows whole: how long they are, where they start, what is fitted from them.
#include <gtest/gtest.h>

#include <cmath>

#include "faultline/fit/parameter_fit.h"
#include "faultline/gap/diagnose_gap.h"
#include "faultline/numerics/random.h"
#include "faultline/rig/time_scales.h"
#include "faultline/segments/own_start.h"
#include "faultline/segments/propagation.h"
#include "faultline/segments/segment_length.h"
#include "faultline/segments/state_smoother.h"
#include "own_rig/own_rigs.h"

namespace faultline {
namespace {

const Datasheet& tanks() {
  static const Datasheet sheet = own_rig("two_tanks");
  return sheet;
}

std::size_t parameter(const std::string& name) { return static_cast<std::size_t>(tanks().parameter(name)); }

struct TankRun {
  Recording recording;
  std::vector<double> upper;  // true level per row, m
};

// The pump steps at random every 80 s; the upper tank starts far from where the rig's own start has it.
TankRun tank_run(const ModelChange& truth, std::size_t rows, std::uint64_t seed, double upper, double period = 4) {
  const double noise = tanks().channels[1].noise_std;
  TankRun run;
  run.recording.rig = tanks().rig;
  run.recording.channels = tanks().channels;
  Random random(seed);
  for (std::size_t k = 0; k < rows; ++k) {
    Sample sample;
    sample.time = period * static_cast<double>(k);
    const auto held = static_cast<std::size_t>(80 / period);
    sample.values.resize(2);
    sample.values[0] = k % held ? run.recording.values[2 * k - 2] : random.uniform(3, 7);
    run.recording.append(sample);
  }
  Propagation model(tanks(), truth, period);
  Eigen::VectorXd state(2);
  state << upper, 0.1;
  for (std::size_t k = 0; k < rows; ++k) {
    run.upper.push_back(state[0]);
    const double shown = std::min(state[1] + noise * random.normal(), tanks().channels[1].maximum);
    if (k + 1 < rows) state = model.step(run.recording, k, state).next;
    run.recording.values[2 * k + 1] = shown;
  }
  return run;
}

SegmentedRun prepared(const SegmentModel& model, const Recording& recording, std::vector<double>& noise) {
  SegmentedRun run = cut_run(tanks(), "tanks", recording, segment_length(tanks(), {&recording}));
  noise = noise_of(tanks(), {run});
  model.place_starts(run, noise, model.nominal());
  return run;
}

TEST(SegmentLength, FollowsTheRigAndTheRuns) {
  const Recording one = tank_run({tanks().nominal(), {}}, 1024, 1, 0.1).recording;
  EXPECT_NEAR(segment_length(tanks(), {&one}), 256, 1e-9);  // a sixteenth of the run
  EXPECT_NEAR(segment_length(tanks(), {&one, &one}), 512, 1e-9);
  EXPECT_NEAR(segment_length(tanks()), 10 * time_scales(tanks()).slowest_s, 1e-9);
  const Recording brief = tank_run({tanks().nominal(), {}}, 100, 1, 0.1).recording;
  EXPECT_NEAR(segment_length(tanks(), {&brief}), 80, 1e-9);  // twenty samples
  Datasheet given = tanks();
  given.segment = 100;
  EXPECT_EQ(segment_length(given, {&one}), 100);
}

TEST(StateSmoother, FindsTheLevelThatIsNotMeasured) {
  const TankRun run = tank_run({tanks().nominal(), {}}, 512, 3, 0.3);
  const SegmentModel model(tanks());
  std::vector<double> noise;
  const SegmentedRun cut = prepared(model, run.recording, noise);
  const std::vector<int> hidden = hidden_states(model, cut);
  ASSERT_EQ(hidden.size(), 1u);
  EXPECT_EQ(hidden.front(), 0);
  ASSERT_EQ(cut.start_roots.front().cols(), 2);
  for (std::size_t g = 0; g < cut.segments(); ++g) {
    const double std = std::abs(cut.start_roots[g](0, 1)), off = cut.starts[g][0] - run.upper[cut.restarts[g]];
    EXPECT_LT(std, 0.03) << g;
    EXPECT_LT(std::abs(off), 3 * std + 1e-4) << g;
  }
  const Eigen::MatrixXf r =
      settled(cut, model.start_columns(model.nominal(), cut, noise), model.residuals(model.nominal(), cut, noise));
  EXPECT_NEAR(r.squaredNorm() / static_cast<float>(r.size()), 1, 0.15);
}

// The same tanks by their outputs alone: no state is said to be what a channel shows.
Datasheet tanks_without_shown_states() {
  Datasheet sheet = tanks();
  for (State& state : sheet.states) state.channel = -1;
  return sheet;
}

TEST(StateSmoother, FindsAllStatesWhereNoChannelShowsAny) {
  const Datasheet sheet = tanks_without_shown_states();
  const TankRun run = tank_run({sheet.nominal(), {}}, 512, 3, 0.3);
  const SegmentModel model(sheet);
  SegmentedRun cut = cut_run(sheet, "tanks", run.recording, segment_length(sheet, {&run.recording}));
  const std::vector<double> noise = noise_of(sheet, {cut});
  model.place_starts(cut, noise, model.nominal());
  EXPECT_EQ(hidden_states(model, cut), (std::vector<int>{0, 1}));
  for (std::size_t g = 0; g < cut.segments(); ++g) {
    const Eigen::MatrixXd& root = cut.start_roots[g];
    EXPECT_LT(root.row(0).norm(), 0.03) << g;
    EXPECT_LT(std::abs(cut.starts[g][0] - run.upper[cut.restarts[g]]), 3 * root.row(0).norm() + 1e-4) << g;
    EXPECT_LT(root.row(1).norm(), 3e-3) << g;
  }
  const Eigen::MatrixXf r =
      settled(cut, model.start_columns(model.nominal(), cut, noise), model.residuals(model.nominal(), cut, noise));
  EXPECT_NEAR(r.squaredNorm() / static_cast<float>(r.size()), 1, 0.15);
}

TEST(Fit, KnowsTanksOfWhichNoChannelShowsAState) {
  Datasheet sheet = tanks_without_shown_states();
  for (Parameter& p : sheet.parameters) p.identify = p.name == "lower_outlet_area";
  ModelChange truth{sheet.nominal(), {}};
  truth.parameters[parameter("lower_outlet_area")] *= 0.97;
  const ParameterFit fit = fit_parameters(sheet, {{"tanks", tank_run(truth, 1024, 5, 0.3).recording}}, 2);
  EXPECT_NEAR(fit.parameters.front().estimate / fit.parameters.front().nominal, 0.97, 0.01);
  EXPECT_LT(fit.channels[0].after, 1.5 * fit.channels[0].noise);  // with starts as they are smoothed
}

TEST(StateSmoother, LeavesReadingsAtTheEndOfTheRangeOut) {
  TankRun run = tank_run({tanks().nominal(), {}}, 512, 3, 0.3);
  Datasheet low = tanks();
  low.channels[1].maximum = 0.16;
  std::size_t at_end = 0;
  for (std::size_t k = 0; k < run.recording.rows(); ++k) {
    double& level = run.recording.values[2 * k + 1];
    at_end += level >= 0.16;
    level = std::min(level, 0.16);
  }
  run.recording.channels = low.channels;
  ASSERT_GT(at_end, 60u);
  SegmentedRun cut = cut_run(low, "tanks", run.recording, 256);
  const SegmentModel model(low);
  const std::vector<double> noise = noise_of(low, {cut});
  EXPECT_NEAR(noise[0], low.channels[1].noise_std, 0.2 * low.channels[1].noise_std);
  model.place_starts(cut, noise, model.nominal());
  const Eigen::MatrixXf r =
      settled(cut, model.start_columns(model.nominal(), cut, noise), model.residuals(model.nominal(), cut, noise));
  EXPECT_LT(r.squaredNorm() / static_cast<float>(r.size()), 1.3);
}

TEST(ParameterFit, KnowsTanksWhoseUpperLevelIsNotMeasured) {
  Datasheet sheet = tanks();
  for (Parameter& p : sheet.parameters) p.identify = p.name == "upper_outlet_area" || p.name == "lower_outlet_area";
  ModelChange truth{sheet.nominal(), {}};
  truth.parameters[parameter("upper_outlet_area")] *= 1.03;
  truth.parameters[parameter("lower_outlet_area")] *= 0.97;
  const TankRun run = tank_run(truth, 1024, 5, 0.3);
  const ParameterFit fit = fit_parameters(sheet, {{"tanks", run.recording}}, 2);
  EXPECT_EQ(fit.segments, 16u);
  ASSERT_EQ(fit.parameters.size(), 2u);
  EXPECT_NEAR(fit.parameters[1].estimate / fit.parameters[1].nominal, 0.97, 0.01);
  EXPECT_LT(fit.channels[0].after, 1.3 * fit.channels[0].noise);
}

TEST(Fit, OfRunsOfDifferentPeriodsDoesNotHangOnTheirOrder) {
  const Recording fast = tank_run({tanks().nominal(), {}}, 512, 7, 0.2).recording,
                  slow = tank_run({tanks().nominal(), {}}, 256, 8, 0.1, 8).recording;
  const ParameterFit one = fit_parameters(tanks(), {{"fast", fast}, {"slow", slow}}, 2);
  const ParameterFit other = fit_parameters(tanks(), {{"slow", slow}, {"fast", fast}}, 2);
  ASSERT_EQ(one.parameters.size(), other.parameters.size());
  for (std::size_t i = 0; i < one.parameters.size(); ++i) {
    const FittedParameter &a = one.parameters[i], &b = other.parameters[i];
    EXPECT_NEAR(a.estimate, b.estimate, 1e-3 * a.estimate) << a.name;
    EXPECT_NEAR(a.high - a.low, b.high - b.low, 0.05 * (a.high - a.low)) << a.name;
  }
}

TEST(Fit, TakesSegmentsOfFewerValuesThanParameters) {
  Datasheet sheet = tanks();
  sheet.segment = 16;  // four samples of one output
  sheet.parameters[0].tolerance = 0.02;
  for (Parameter& p : sheet.parameters) p.identify = true;
  ModelChange truth{sheet.nominal(), {}};
  truth.parameters[parameter("lower_outlet_area")] *= 0.97;
  const ParameterFit fit = fit_parameters(sheet, {{"tanks", tank_run(truth, 512, 9, 0.2).recording}}, 2);
  EXPECT_EQ(fit.segments, 128u);
  ASSERT_EQ(fit.parameters.size(), 4u);
  for (const FittedParameter& p : fit.parameters) EXPECT_NEAR(p.estimate / p.nominal, 1, 0.08) << p.name;
  EXPECT_LT(fit.channels[0].after, 1.3 * fit.channels[0].noise);
}

TEST(StateSmoother, SaysWhichRigsRunOnFromTheirOwnStart) {
  const Datasheet chain = own_rig("long_chain");  // twenty states, no channel shows one
  EXPECT_NE(remark_of_own_start(chain, 0.1).find("20 states"), std::string::npos);
  EXPECT_EQ(remark_of_own_start(chain, 1000), "");  // forgotten within a segment
  EXPECT_EQ(remark_of_own_start(tanks(), 0.1), "");
}

// Two runs of different sample periods. (A clogged outlet could as well be a pump and a transducer that are off:
// without the upper level nobody can tell.)
TEST(Gap, OfTanksNamesThePumpThatStartsLate) {
  const EffectSpec late = parse_effect("deadband@command.pump_voltage:width=1.6");
  const Recording first = tank_run({tanks().nominal(), {late}}, 1024, 7, 0.2).recording,
                  second = tank_run({tanks().nominal(), {late}}, 512, 8, 0.1, 8).recording;
  const double segment = segment_length(tanks(), {&first, &second});
  GapSettings settings;
  settings.jobs = 2;
  const GapResult result = diagnose_gap(
      tanks(), {cut_run(tanks(), "a", first, segment), cut_run(tanks(), "b", second, segment)}, {}, settings, {});
  ASSERT_EQ(result.verdict, "named") << result.sentence;
  ASSERT_EQ(result.effects.front().effect, "deadband") << result.sentence;
  EXPECT_NEAR(result.effects.front().parameters.at("width"), 1.6, 0.2);
}

// Where nothing but the lower level is known, the model without the cause puts both tanks elsewhere: what a cause wins
// must be weighed around starts of its own.
TEST(Gap, OfTanksOfWhichNoChannelShowsAStateNamesTheOutlet) {
  const Datasheet sheet = tanks_without_shown_states();
  const EffectSpec clogged = parse_effect("clogging@restriction.lower_outlet:fraction=0.3");
  const Recording first = tank_run({sheet.nominal(), {clogged}}, 768, 7, 0.2).recording,
                  second = tank_run({sheet.nominal(), {clogged}}, 768, 8, 0.1).recording;
  const double segment = segment_length(sheet, {&first, &second});
  GapSettings settings;
  settings.jobs = 2;
  const GapResult result = diagnose_gap(
      sheet, {cut_run(sheet, "a", first, segment), cut_run(sheet, "b", second, segment)}, {}, settings, {});
  ASSERT_EQ(result.verdict, "named") << result.sentence;
  ASSERT_EQ(result.effects.front().effect, "clogging") << result.sentence;
  EXPECT_EQ(result.effects.front().port, "restriction.lower_outlet");
  EXPECT_NEAR(result.effects.front().parameters.at("fraction"), 0.3, 0.05);
}

TEST(Gap, OfTanksAsTheDatasheetHasThemIsNone) {
  const Recording first = tank_run({tanks().nominal(), {}}, 1024, 7, 0.2).recording,
                  second = tank_run({tanks().nominal(), {}}, 1024, 8, 0.1).recording;
  const double segment = segment_length(tanks(), {&first, &second});
  GapSettings settings;
  settings.jobs = 2;
  const GapResult result = diagnose_gap(
      tanks(), {cut_run(tanks(), "a", first, segment), cut_run(tanks(), "b", second, segment)}, {}, settings, {});
  EXPECT_EQ(result.verdict, "none") << result.sentence;
}

}  // namespace
}  // namespace faultline
