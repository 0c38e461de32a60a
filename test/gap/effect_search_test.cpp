// The search for effects: sizes that derivatives do not find, two effects at once, and what a rig without one leaves.
#include "faultline/gap/effect_search.h"

#include <gtest/gtest.h>

#include <cmath>

#include "faultline/gap/diagnose_gap.h"
#include "faultline/gap/diagnose_runs.h"
#include "faultline/gap/effect_worth.h"
#include "faultline/gap/run_phases.h"
#include "faultline/gap/size_search.h"
#include "faultline/gap/spectral_lines.h"
#include "rigs/pump_cylinder/runs.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

constexpr double kSegment = 0.25;  // s
constexpr const char* kLeak = "laminar_leakage@flow.chamber_a_chamber_b:coefficient=5e-11";

// Adds to a channel noise that forgets itself in `memory` s.
void add_noise(const Datasheet& sheet, Recording& recording, const std::string& channel, double size, double memory,
               std::uint64_t seed) {
  Random random(seed);
  const auto column = static_cast<std::size_t>(sheet.channel(channel));
  const double keep = std::exp(-sheet.sample_period / memory);
  double noise = size * random.normal();
  for (std::size_t k = 0; k < recording.rows(); ++k) {
    recording.values[k * recording.columns() + column] += noise;
    noise = keep * noise + size * std::sqrt(1 - keep * keep) * random.normal();
  }
}

// `noisy`: in Pa, of chamber A's transducer, with a memory of 20 ms.
std::vector<SegmentedRun> runs_with(const std::vector<std::string>& effects, double noisy = 0) {
  std::vector<SegmentedRun> runs;
  std::uint64_t seed = 11;
  for (const char* profile : {"multisine", "square"}) {
    SimulationSetup setup = servo_setup(profile, seed++);
    setup.parameters = draw_parameters(servo(), 11);
    for (const std::string& effect : effects) setup.effects.push_back(parse_effect(effect));
    Recording recording = simulate(servo(), setup, 6);
    if (noisy > 0) add_noise(servo(), recording, "chamber_a_pressure", noisy, 0.02, seed);
    runs.push_back(cut_run(servo(), profile, std::move(recording), kSegment));
  }
  return runs;
}

// Candidates at these ports only.
GapSettings among(const Datasheet& sheet, const std::vector<std::string>& ports) {
  GapSettings settings;
  settings.jobs = 2;
  for (const Port& port : sheet.ports)
    if (std::find(ports.begin(), ports.end(), port.name) == ports.end())
      for (const FittingEffect& fitting : port.effects) settings.without.push_back(fitting.effect + "@" + port.name);
  return settings;
}

const std::vector<Fold> kFolds = {{{0}, {1}}, {{1}, {0}}};
const GapProgress kSilent;

EffectSearch search_among(const std::vector<std::string>& ports, const std::vector<std::string>& effects,
                          double noisy = 0) {
  const GapSettings settings = among(servo(), ports);
  GapTrials work(servo(), runs_with(effects, noisy), kFolds, {0, 1}, settings, kSilent);
  return search_effects(work, 3, 0.05);
}

std::string found(const EffectSearch& search) {
  std::string all;
  for (std::size_t round = 0; round < search.round_of.size(); ++round) {
    const EffectSpec& effect = search.base.effects[position_of(search, round)].effect;
    all += effect.effect + "@" + effect.port + " ";
  }
  return all;
}

// Two runs of a rig off its datasheet, with a dead band and a leak.
std::vector<SegmentedRun> dead_and_leaking(std::uint64_t rig) {
  std::vector<SegmentedRun> runs;
  for (const char* profile : {"multisine", "triangle"}) {
    SimulationSetup setup = servo_setup(profile, 5);
    setup.parameters = draw_parameters(servo(), rig);
    for (const char* effect : {"deadband@restriction.valve:width=0.6", kLeak})
      setup.effects.push_back(parse_effect(effect));
    runs.push_back(cut_run(servo(), profile, simulate(servo(), setup, 6), kSegment));
  }
  return runs;
}

// The leak by an orifice that the first round took for a laminar one, beside a dead band, is left without a flow.
TEST(DiagnoseGap, TellsNoCauseThatTheOthersDoWithout) {
  const std::vector<SegmentedRun> runs = dead_and_leaking(4);
  const GapSettings settings = among(servo(), {"restriction.valve", "flow.chamber_a_chamber_b"});
  const GapResult all = diagnose_runs(servo(), servo(), runs, {}, settings, kSilent);
  ASSERT_EQ(all.effects.size(), 3u) << all.sentence;
  EXPECT_EQ(all.effects.front().effect, "orifice_leakage");
  for (const NamedEffect& effect : all.effects) EXPECT_EQ(effect.least, effect.effect == "orifice_leakage");
  const GapResult result = diagnose_gap(servo(), runs, {}, settings, kSilent);
  EXPECT_EQ(result.verdict, "named");
  ASSERT_EQ(result.effects.size(), 2u) << result.sentence;
  EXPECT_EQ(result.effects.front().effect, "laminar_leakage");
  EXPECT_NEAR(result.effects.front().parameters.at("coefficient"), 5e-11, 2e-12);
  EXPECT_EQ(result.effects.back().effect, "deadband");
}

TEST(Narrow, FindsTheDeepestOfSeveralValleys) {
  const auto f = [](double x) { return std::cos(20 * x) + 2 * std::pow(x - 0.8, 2); };
  const double at = narrow(f, 0, 1, 11, 1e-4);
  for (int i = 0; i <= 1000; ++i) EXPECT_LE(f(at), f(1e-3 * i) + 1e-6);
  EXPECT_NEAR(narrow([](double x) { return x; }, 2, 3, 5, 1e-3), 2, 1e-3);  // at the edge
}

// One cause in one branch closes what its output lacks, and little of all.
TEST(EffectWorth, IsWhatIsClosedOfTheOutputThatItClosesMost) {
  Eigen::MatrixXf before(4, 3), after(4, 3);
  before << 0, 9, 2,  //
      -3, 0, -2,      // 0: does not count
      3, -9, 0,       //
      0, 9, 2;
  after = before;
  after.col(0) *= 0.5f;  // 8 -> 1.25 beyond the noise
  EXPECT_NEAR(closes_one_output({before, before}, {after, after}, 1), 1 - 1.25 / 8, 1e-6);
  EXPECT_NEAR(closes_one_output({before}, {before}, 1), 0, 1e-6);
  after = before;
  after.col(2) *= 0.1f;  // 3 -> 0
  EXPECT_NEAR(closes_one_output({before}, {after}, 1), 1, 1e-6);
  EXPECT_NEAR(closes_one_output({before}, {after}, 5), 0, 1e-6);  // what is left there is not large
}

// Candidates that only do harm, from sizes that one round of fitting does not bring back.
TEST(GapTrials, TheBestIsScoredWhereNoneWins) {
  const GapSettings settings = among(servo(), {"force.piston", "flow.chamber_a_tank"});
  GapTrials work(servo(), runs_with({}), kFolds, {0, 1}, settings, kSilent);
  ModelChange nominal;
  nominal.parameters = servo().nominal();
  const FitResult base = work.refit(nominal, {});
  std::vector<Structure> structures = work.screen(base, 0, 1);
  ASSERT_GT(structures.size(), 2u);
  for (Structure& structure : structures) {
    Candidate& candidate = structure.fit.effects.back();
    for (std::size_t p = 0; p < candidate.bounds.size(); ++p)
      candidate.effect.parameters[p] = candidate.bounds[p].maximum;
    structure.fit.model = with_effects(structure.fit.effects, base.model.parameters);
  }
  const std::size_t all = structures.size(), kept = work.refine(structures, 0, 1);
  EXPECT_LT(structures.front().quick, 0);
  EXPECT_EQ(kept, 1u);
  ASSERT_EQ(structures.size(), all);
  EXPECT_FALSE(structures.front().score.empty());
}

// Beside a rig without a leak the least of its range wins what the parameters win that come with it.
TEST(EffectWorth, TheLeastThatIsTriedIsASizeWhereLessWinsLess) {
  const auto leaks = [](const std::vector<std::string>& effects, double flow) {
    const GapSettings settings = among(servo(), {"flow.chamber_a_chamber_b"});
    GapTrials work(servo(), runs_with(effects), kFolds, {0, 1}, settings, kSilent);
    ModelChange beside;
    beside.parameters = servo().nominal();
    beside.parameters[static_cast<std::size_t>(servo().parameter("flow_coefficient"))] *= flow;
    std::vector<Structure> structures = work.screen(work.stand(beside), 0, 1);
    structures.erase(
        std::remove_if(structures.begin(), structures.end(),
                       [](const Structure& s) { return s.fit.effects.back().effect.effect != "orifice_leakage"; }),
        structures.end());
    // A range that ends above a small leak.
    FitResult& fit = structures.front().fit;
    fit.effects.back().bounds.front().minimum = fit.effects.back().effect.parameters.front() = 1e-9;
    fit.model = with_effects(fit.effects, fit.model.parameters);
    work.refine(structures, 0, 1);
    EXPECT_GT(work.learned_gain(structures.front()), 0);
    EXPECT_NEAR(structures.front().fit.effects.back().effect.parameters.front(), 1e-9, 1e-11);
    return !has_no_size(work, structures.front());
  };
  EXPECT_FALSE(leaks({}, 1.2));
  EXPECT_TRUE(leaks({"orifice_leakage@flow.chamber_a_chamber_b:coefficient=8e-10"}, 1));
}

// Alone, a leak by an orifice closes more than the laminar one does without the dead band.
TEST(DiagnoseGap, WhatMimicsTwoCausesIsNotNamedForThem) {
  const GapSettings settings = among(servo(), {"restriction.valve", "flow.chamber_a_chamber_b"});
  const GapResult result = diagnose_gap(servo(), dead_and_leaking(6), {}, settings, kSilent);
  EXPECT_EQ(result.verdict, "named");
  ASSERT_EQ(result.effects.size(), 2u) << result.sentence;
  EXPECT_EQ(result.effects.front().effect, "deadband");
  EXPECT_NEAR(result.effects.front().parameters.at("width"), 0.6, 0.05);
  EXPECT_EQ(result.effects.back().effect, "laminar_leakage");
  EXPECT_NEAR(result.effects.back().parameters.at("coefficient"), 5e-11, 2e-12);
}

// A refit that stands beside the rig: what an effect wins with better parameters is the parameters'.
TEST(GapTrials, AModelBesideTheRigIsBetterWithoutTheEffect) {
  const GapSettings settings = among(servo(), {"force.piston"});
  GapTrials work(servo(), runs_with({}), kFolds, {0, 1}, settings, kSilent);
  ModelChange beside;
  beside.parameters = servo().nominal();
  beside.parameters[static_cast<std::size_t>(servo().parameter("flow_coefficient"))] *= 1.2;
  const FitResult base = work.stand(beside);
  std::vector<Structure> structures = work.screen(base, 0, 1);
  structures.resize(1);
  work.refine(structures, 0, 1);
  EXPECT_TRUE(work.better_without(structures.front()));
  const FitResult again = work.refit(without_last(structures.front().fit).model, {});
  EXPECT_TRUE(again.effects.empty());
  EXPECT_FALSE(work.better_without(structures.front()));
}

TEST(EffectSearch, NothingWhereNothingIsMissing) {
  const EffectSearch search = search_among({"transmission.rod", "force.piston", "flow.chamber_a_chamber_b"}, {});
  EXPECT_EQ(found(search), "");
  EXPECT_EQ(search.apart.size(), 0u);
}

// On a rig whose transducers are far better than their datasheet nothing is taken for the noise of its measured inputs.
TEST(EffectSearch, FindsBothOfTwoBesideQuietTransducers) {
  Datasheet quiet = servo();
  for (Channel& channel : quiet.channels) channel.noise_std *= 0.02, channel.resolution *= 0.02;
  std::vector<SegmentedRun> runs;
  for (const char* profile : {"multisine", "steps"}) {
    SimulationSetup setup = servo_setup(profile, 11 + runs.size());
    setup.parameters = draw_parameters(servo(), 11);
    setup.effects = {parse_effect("deadband@restriction.valve:width=0.05"),
                     parse_effect("offset@sensor.chamber_b_pressure:value=6000")};
    runs.push_back(cut_run(servo(), profile, simulate(quiet, setup, 6), kSegment));
  }
  const GapSettings settings = among(servo(), {"restriction.valve", "sensor.chamber_b_pressure"});
  GapTrials work(servo(), std::move(runs), kFolds, {0, 1}, settings, kSilent);
  const EffectSearch search = search_effects(work, 3, 0.05);
  EXPECT_NE(found(search).find("deadband@restriction.valve"), std::string::npos) << found(search);
  EXPECT_NE(found(search).find("offset@sensor.chamber_b_pressure"), std::string::npos) << found(search);
}

// Two laws at one place: what a hair's breadth from sample to sample says does not count against much over segments.
TEST(EffectSearch, OfTwoLawsTheOneIsTakenThatDoesBestInBoth) {
  std::vector<SegmentedRun> runs;
  for (const char* profile : {"multisine", "random"}) {
    SimulationSetup setup = servo_setup(profile, 5 + runs.size());
    setup.parameters = servo().nominal();
    setup.effects = {parse_effect("orifice_leakage@flow.chamber_a_chamber_b:coefficient=3e-9")};
    runs.push_back(cut_run(servo(), profile, simulate(servo(), setup, 12), kSegment));
  }
  const GapSettings settings = among(servo(), {"flow.chamber_a_chamber_b"});
  GapTrials work(servo(), std::move(runs), kFolds, {0, 1}, settings, kSilent);
  EXPECT_EQ(found(search_effects(work, 1, 0.05)), "orifice_leakage@flow.chamber_a_chamber_b ");
}

// A spring of twice what the datasheet thinks of: what the end of its range leaves is no second effect's.
TEST(EffectSearch, ASizeMayLieBeyondTheRange) {
  const EffectSearch search = search_among({"force.piston"}, {"load_force@force.piston:constant=0,stiffness=2e4"});
  ASSERT_EQ(found(search), "load_force@force.piston ");
  EXPECT_NEAR(search.base.effects.front().effect.parameters[1], 2e4, 1e3);
}

// From a starting point far off, the play has a valley that a Gauss-Newton step does not find.
TEST(EffectSearch, FindsAPlay) {
  const EffectSearch search =
      search_among({"transmission.rod", "compliance.chambers"}, {"backlash@transmission.rod:gap=0.003"});
  ASSERT_EQ(found(search), "backlash@transmission.rod ");
  EXPECT_NEAR(search.base.effects.front().effect.parameters.front(), 0.003, 2e-4);
}

TEST(EffectSearch, FindsAnOilColumnBesideALeak) {
  const EffectSearch search = search_among(
      {"line.valve_cylinder", "flow.chamber_a_chamber_b"},
      {"line_inertia@line.valve_cylinder:inertance=1e8", "laminar_leakage@flow.chamber_a_chamber_b:coefficient=2e-11"});
  ASSERT_EQ(search.base.effects.size(), 2u) << found(search);
  EXPECT_NE(found(search).find("line_inertia@line.valve_cylinder"), std::string::npos) << found(search);
  EXPECT_NE(found(search).find("leakage@flow.chamber_a_chamber_b"), std::string::npos) << found(search);
  EXPECT_EQ(search.apart.size(), 2u);
}

// A frequency between all starting points, known from the lines of the spectrum.
TEST(EffectSearch, FindsTheFrequencyOfARipple) {
  const EffectSearch search = search_among({"source.supply_pressure", "flow.chamber_a_tank"},
                                           {"ripple@source.supply_pressure:amplitude=9e5,frequency=23.7"});
  ASSERT_EQ(found(search), "ripple@source.supply_pressure ");
  const std::vector<double>& size = search.base.effects.front().effect.parameters;
  EXPECT_NEAR(size[0], 9e5, 5e4);
  EXPECT_NEAR(size[1], 23.7, 0.02);
}

// A pump pulses on between recordings.
TEST(EffectSearch, ARippleHasAnotherPhaseInEachRun) {
  constexpr double kFrequency = 23.7, kTwoPi = 6.283185307179586;
  const auto of = [&](double phase) {
    return std::vector<std::string>{"ripple@source.supply_pressure:amplitude=9e5,frequency=23.7,phase=" +
                                    std::to_string(phase)};
  };
  const GapSettings settings = among(servo(), {"source.supply_pressure", "flow.chamber_a_tank"});
  for (const double other : {0.9, -1.8}) {
    std::vector<SegmentedRun> runs = runs_with(of(0.9));
    runs[1] = runs_with(of(other))[1];
    GapTrials work(servo(), runs, kFolds, {0, 1}, settings, kSilent);
    const EffectSearch search = search_effects(work, 3, 0.05);
    ASSERT_EQ(found(search), "ripple@source.supply_pressure ") << other;
    const std::vector<double>& size = search.base.effects.front().effect.parameters;
    EXPECT_NEAR(size[0], 9e5, 5e4) << other;
    EXPECT_NEAR(size[1], kFrequency, 0.02) << other;
    EXPECT_NEAR(std::remainder(size[2] - 0.9, kTwoPi), 0, 0.25) << other;
    const double ahead = kTwoPi * kFrequency * work.model().runs()[1].ahead;
    if (other == 0.9)
      EXPECT_EQ(ahead, 0);
    else
      EXPECT_NEAR(std::remainder(ahead - (other - 0.9), kTwoPi), 0, 0.3);
  }
}

// Of all lines of the spectrum two remain that win most, and least squares say how large and at which phase.
TEST(RunPhases, BeginWhatSwingsWhereItWinsMost) {
  const GapSettings settings = among(servo(), {"source.supply_pressure"});
  ResidualModel model(servo(), runs_with({"ripple@source.supply_pressure:amplitude=9e5,frequency=23.7,phase=0.9"}),
                      settings.options);
  const ModelChange plain{draw_parameters(servo(), 11), {}};
  const std::vector<Eigen::MatrixXf> residuals{model.residuals(plain, 0), model.residuals(plain, 1)};
  const double period = servo().sample_period;
  std::vector<Candidate> all =
      at_lines(candidates(servo(), settings.without), residuals, {period, period}, settings.options.spectrum);
  const std::size_t before = all.size();
  ASSERT_GT(before, 2u);
  run_phases(model, plain, all, 1);
  const auto swings = [](const Candidate& candidate) { return candidate.effect.effect == "ripple"; };
  EXPECT_LE(std::count_if(all.begin(), all.end(), swings), 2);
  const auto first = std::find_if(all.begin(), all.end(), swings);
  ASSERT_NE(first, all.end());
  const Candidate& ripple = *first;  // lines are sorted
  ASSERT_EQ(starting_points(ripple).size(), 3u);
  const std::vector<double> start = starting_points(ripple)[1];
  EXPECT_NEAR(start[0], 9e5, 2e5);
  EXPECT_NEAR(start[1], 23.7, 0.08);
  EXPECT_NEAR(start[2] + 6.2832 * 3 * (start[1] - 23.7), 0.9, 0.3);  // in the middle of 6 s
}

// A pump stands somewhere when a recording begins, and how many pistons it has nobody says. Its size trades with the
// oil's modulus.
TEST(EffectSearch, APumpsRippleHasAnOrderAndAnotherPhaseInEachRun) {
  std::vector<SegmentedRun> runs;
  for (const char* phase : {"0.7", "-1.9"}) {
    const std::string ripple = "displacement_ripple@source.pump2:amplitude=0.06,order=7,phase=" + std::string(phase);
    const std::string profile = runs.empty() ? "multisine" : "varied_steps";
    const SimulationSetup setup = cylinder_setup(profile, {ripple}, 21 + runs.size());
    runs.push_back(cut_run(cylinder(), profile, simulate(cylinder(), setup, 10), kSegment));
  }
  const GapSettings settings = among(cylinder(), {"source.pump2", "flow.pump2_a_b"});
  GapTrials work(cylinder(), std::move(runs), kFolds, {0, 1}, settings, kSilent);
  const EffectSearch search = search_effects(work, 3, 0.05);
  ASSERT_EQ(found(search), "displacement_ripple@source.pump2 ");
  const std::vector<double>& size = search.base.effects.front().effect.parameters;
  EXPECT_NEAR(size[0], 0.06, 0.04);
  EXPECT_EQ(size[1], 7);
  EXPECT_NEAR(size[2], 0.7, 0.35);
  EXPECT_NEAR(7 * work.model().runs()[1].turned, -2.6, 0.4);
}

// A free signal is hardly like a ripple, and beside an oil column wins little: while a gap is large the search goes on.
TEST(EffectSearch, GoesOnWhileTheGapIsLarge) {
  const EffectSearch search = search_among({"source.supply_pressure", "line.valve_cylinder"},
                                           {"line_inertia@line.valve_cylinder:inertance=1.5e8",
                                            "ripple@source.supply_pressure:amplitude=1e6,frequency=21.6"});
  EXPECT_NE(found(search).find("line_inertia@line.valve_cylinder"), std::string::npos) << found(search);
  EXPECT_NE(found(search).find("ripple@source.supply_pressure"), std::string::npos) << found(search);
}

// What a slow transducer leaves out looks much like noise with a memory.
TEST(EffectSearch, ALagOfATransducerIsNoNoise) {
  std::vector<SegmentedRun> runs;
  for (const char* profile : {"multisine", "varied_steps"}) {
    SimulationSetup setup = cylinder_off_nominal(profile, 21 + runs.size());
    setup.parameters = draw_parameters(cylinder(), 21);
    setup.effects.push_back(parse_effect("lag@sensor.chamber_a_pressure:time_constant=0.1"));
    runs.push_back(cut_run(cylinder(), profile, simulate(cylinder(), setup, 8), kSegment));
  }
  const GapSettings settings = among(cylinder(), {"sensor.chamber_a_pressure", "sensor.chamber_b_pressure"});
  GapTrials work(cylinder(), std::move(runs), kFolds, {0, 1}, settings, kSilent);
  const EffectSearch search = search_effects(work, 3, 0.05);
  EXPECT_EQ(found(search), "lag@sensor.chamber_a_pressure ");
  EXPECT_TRUE(search.noise.empty());
}

// From sample to sample the second lag is not likely; over segments it closes all that is left.
TEST(EffectSearch, FindsALagBesideALag) {
  const std::vector<std::string> effects = {"lag@command.pump2_speed:time_constant=0.003",
                                            "lag@sensor.chamber_b_pressure:time_constant=0.03"};
  std::vector<SegmentedRun> runs;
  for (const char* profile : {"multisine", "varied_steps"}) {
    SimulationSetup setup = cylinder_off_nominal(profile, 21 + runs.size());
    setup.parameters = draw_parameters(cylinder(), 21);
    for (const std::string& effect : effects) setup.effects.push_back(parse_effect(effect));
    runs.push_back(cut_run(cylinder(), profile, simulate(cylinder(), setup, 8), kSegment));
  }
  const GapSettings settings = among(cylinder(), {"command.pump2_speed", "sensor.chamber_b_pressure"});
  GapTrials work(cylinder(), std::move(runs), kFolds, {0, 1}, settings, kSilent);
  EXPECT_EQ(found(search_effects(work, 3, 0.05)), "lag@command.pump2_speed lag@sensor.chamber_b_pressure ");
}

// An oil column that is not worth it alone, in what a leak leaves, is on trial until the leak is found beside it; where
// both together are not worth it either, all is as it was before.
TEST(EffectSearch, WhatIsNotWorthItAloneMayBeWithAnother) {
  GapSettings settings = among(servo(), {"line.valve_cylinder", "flow.chamber_a_chamber_b"});
  settings.without.push_back("orifice_leakage");
  settings.options.search.evidence_fraction = 0.6;  // more than the column wins alone
  const auto search_with = [&](double least_closed, int most_effects) {
    settings.options.verdict.hidden_shrink_fraction = least_closed;
    GapTrials work(servo(),
                   runs_with({"line_inertia@line.valve_cylinder:inertance=1e8",
                              "laminar_leakage@flow.chamber_a_chamber_b:coefficient=2e-11"}),
                   kFolds, {0, 1}, settings, kSilent);
    EffectSearch search = search_effects(work, most_effects, 0.05);
    // What stands in the trials is what was found.
    const double held_out = sum(work.held_out(search.base.model)), said = sum(search.losses);
    EXPECT_NEAR(held_out, said, 0.05 * said);
    return search;
  };
  const auto won = [](const EffectSearch& search) { return 1 - search.after.loss / search.before.loss; };
  EXPECT_EQ(found(search_with(0.5, 1)), "");
  const EffectSearch both = search_with(0.5, 2);
  EXPECT_EQ(both.base.effects.size(), 2u);
  EXPECT_GT(won(both), settings.options.search.evidence_fraction);
  const EffectSearch none = search_with(1.5, 2);  // nothing closes more than all
  EXPECT_EQ(found(none), "");
  EXPECT_EQ(won(none), 0);
}

// The steps of one run reach the limit, the other run hardly does: what it cannot show does not speak against the
// effect.
TEST(EffectSearch, ARunThatShowsNothingHasNoSay) {
  const EffectSearch search =
      search_among({"command.valve_command", "force.piston"},
                   {"rate_limit@command.valve_command:rate=60", "added_mass@force.piston:mass=5"});
  EXPECT_NE(found(search).find("rate_limit@command.valve_command"), std::string::npos) << found(search);
}

// A transducer whose noise is not white: what it adds depends on nothing, so it is no cause, and hides none.
TEST(EffectSearch, NoiseWithAMemoryIsNoCause) {
  const std::vector<std::string> ports = {"sensor.chamber_a_pressure", "flow.chamber_a_chamber_b"};
  const EffectSearch healthy = search_among(ports, {}, 4e4);
  EXPECT_EQ(found(healthy), "");
  ASSERT_EQ(healthy.noise.size(), 1u);
  EXPECT_EQ(healthy.noise.front().port, "sensor.chamber_a_pressure");
  EXPECT_NEAR(healthy.noise.front().level, 4e4, 1e4);
  EXPECT_NEAR(healthy.noise.front().memory, 0.02, 0.006);
  EXPECT_LT(healthy.before.places.front().gain, 0.1 * healthy.before.loss);
  const EffectSearch leaking = search_among(ports, {"laminar_leakage@flow.chamber_a_chamber_b:coefficient=2e-11"}, 4e4);
  EXPECT_NE(found(leaking).find("leakage@flow.chamber_a_chamber_b"), std::string::npos) << found(leaking);
}

// So is that of an input that drives the model, though a load would enter at the same place.
TEST(EffectSearch, NoiseWithAMemoryOfAnInputIsNoCause) {
  const Datasheet drive = find_datasheet(config_folder(), "hydraulic_drive");
  GapSettings settings;
  settings.jobs = 2;
  for (const Port& port : drive.ports)
    for (const FittingEffect& fitting : port.effects)
      if (port.name != "force.shaft") settings.without.push_back(fitting.effect + "@" + port.name);
  std::vector<SegmentedRun> runs;
  std::uint64_t seed = 5;
  for (const char* profile : {"multisine", "triangle"}) {
    SimulationSetup setup;
    setup.profile = profile;
    setup.seed = seed++;
    Recording recording = simulate(drive, setup, 20);
    add_noise(drive, recording, "pump_pressure", 2e4, 0.1, seed);
    runs.push_back(cut_run(drive, profile, std::move(recording), 1));
  }
  GapTrials work(drive, std::move(runs), kFolds, {0, 1}, settings, kSilent);
  const EffectSearch search = search_effects(work, 3, 0.05);
  EXPECT_EQ(found(search), "");
  ASSERT_FALSE(search.noise.empty());
  EXPECT_EQ(search.noise.front().port, "sensor.pump_pressure");
  EXPECT_NEAR(search.noise.front().level, 2e4, 1e4);
  EXPECT_LT(search.before.places.front().gain, 0.1 * search.noise.front().gain);
}

// What a slow transducer adds depends on what it shows.
TEST(EffectSearch, ASlowTransducerIsNotTakenForNoise) {
  const EffectSearch search = search_among({"flow.chamber_a_chamber_b"}, {"lag@sensor.velocity:time_constant=0.01"});
  EXPECT_TRUE(search.noise.empty());
  EXPECT_EQ(search.before.places.front().port, "sensor.velocity");
}

}  // namespace
}  // namespace faultline
