// Two effects that are the same as far as a run goes: a command that never changes its sign cannot tell a dead band
// from an offset. Both are followed until they have converged, and both are told. And two parameters that are.
#include <algorithm>

#include <gtest/gtest.h>

#include "faultline/attribution/candidates.h"
#include "faultline/gap/diagnose_gap.h"
#include "faultline/gap/fit_gap.h"
#include "faultline/gap/next_run.h"
#include "faultline/gap/ranked_causes.h"
#include "two_gains.h"

namespace faultline {
namespace {

GapResult diagnose(const Datasheet& sheet, double lowest) {
  std::vector<SegmentedRun> runs;
  for (const std::uint64_t seed : {1, 2})
    runs.push_back(cut_run(sheet, "run", two_gains_run(2, 0.2, 20, seed, 0.8, lowest), 2));
  GapSettings settings;
  settings.jobs = 2;
  return diagnose_gap(sheet, std::move(runs), {}, settings, {});
}

TEST(Rivals, AreBothToldWhereTheRunCannotTellThemApart) {
  Datasheet sheet = two_gains();
  sheet.profiles.clear();  // those that a datasheet gets by itself
  const GapResult result = diagnose(sheet, 1);
  EXPECT_EQ(result.verdict, "named");
  ASSERT_FALSE(result.effects.empty());
  ASSERT_FALSE(result.equivalent.empty());
  EXPECT_EQ(result.equivalent.front().instead_of, result.effects.front().effect + "@" + result.effects.front().port);
  std::map<std::string, double> sizes;
  for (const NamedEffect& e : {result.effects.front(), result.equivalent.front()})
    sizes[e.effect] = e.parameters.begin()->second;
  EXPECT_NEAR(sizes["deadband"], 0.8, 0.1);
  EXPECT_NEAR(sizes["offset"], -0.4, 0.05);
  ASSERT_FALSE(result.remarks.empty());
  EXPECT_NE(result.remarks.front().find("no profile"), std::string::npos);
}

// What may stand for a further effect is told beside the others, with what it stands for.
TEST(Rivals, OfALaterEffectAreToldToo) {
  const std::vector<Candidate> all = candidates(two_gains(), {});
  ASSERT_GE(all.size(), 3u);
  const auto name = [&](std::size_t i) { return all[i].effect.effect + "@" + all[i].effect.port; };
  EffectSearch search;
  search.base.effects = {all[0], all[1]};
  search.round_of = {0, 1};
  search.apart.resize(2);
  Rival rival;
  rival.round = 1;
  rival.fit.effects = {all[0], all[2]};
  rival.standard_error = 2;
  for (const double behind : {3.0, 5.0}) {
    rival.behind = behind;
    search.rivals = {rival};
    GapResult result;
    name_effects(search, 1.645, GapOptions().verdict, result);
    ASSERT_EQ(result.effects.size(), 2u);
    const double weight = std::exp(-0.5 * std::pow(behind / 2, 2));
    EXPECT_NEAR(result.effects[1].probability, 1 / (1 + weight), 1e-9);
    ASSERT_EQ(result.equivalent.size(), behind < 4 ? 1u : 0u);
    if (result.equivalent.empty()) continue;
    EXPECT_EQ(result.equivalent.front().effect + "@" + result.equivalent.front().port, name(2));
    EXPECT_EQ(result.equivalent.front().instead_of, name(1));
    EXPECT_NEAR(result.equivalent.front().probability, weight / (1 + weight), 1e-9);
  }
}

TEST(Rivals, AreToldApartWhereTheRunCan) {
  const GapResult result = diagnose(two_gains(), -4);
  EXPECT_EQ(result.verdict, "named");
  ASSERT_EQ(result.effects.size(), 1u);
  EXPECT_EQ(result.effects.front().effect, "deadband");
  EXPECT_TRUE(result.equivalent.empty());
  EXPECT_TRUE(result.effects.front().at_bounds.empty());
}

// The truth is 0.8. It is looked for up to four times what the datasheet thinks of.
TEST(Rivals, AValueBeyondItsRangeIsToldAndOneAtItsBoundMarked) {
  for (const double widest : {0.4, 0.1}) {
    Datasheet sheet = two_gains();
    for (Port& port : sheet.ports)
      for (FittingEffect& fitting : port.effects)
        if (fitting.effect == "deadband") fitting.bounds["width"] = {0.01, widest};
    const GapResult result = diagnose(sheet, -4);
    ASSERT_FALSE(result.ranked.empty());
    const NamedEffect& first = result.ranked.front().effect;
    EXPECT_EQ(first.effect, "deadband");
    const bool beyond = widest > 0.2;
    EXPECT_NEAR(first.parameters.at("width"), beyond ? 0.8 : 0.4, 0.1);
    EXPECT_EQ(first.at_bounds.empty(), beyond);
    const bool told = std::any_of(result.remarks.begin(), result.remarks.end(), [](const std::string& remark) {
      return remark.find("lies beyond the datasheet's range") != std::string::npos;
    });
    EXPECT_EQ(told, beyond || !result.effects.empty());
  }
}

// A cause for which a refit can make up, but only with several parameters as far off as they may be at once: the gain
// is 1.823 times the datasheet's, and two parameters of 10 % reach 1.8225 times at 3.5 tolerances each.
GapResult diagnose_scaled(std::size_t at_bounds, double dead = 0, double scale = 1.823,
                          const GapOptions& options = {}) {
  Datasheet sheet = two_gains();
  for (const char* gain : {"input_gain", "output_gain"})
    sheet.parameters[static_cast<std::size_t>(sheet.parameter(gain))].tolerance = 0.1;
  for (Port& port : sheet.ports)
    if (port.name == "command.input")
      port.effects = {{"scale", {{"factor", {0.2, 5}}}}, {"deadband", {{"width", {0.05, 2}}}}};
  std::vector<SegmentedRun> runs;
  for (const std::uint64_t seed : {1, 2})
    runs.push_back(cut_run(sheet, "run", two_gains_run(2 * scale, 0.2, 20, seed, dead, -4), 2));
  GapSettings settings;
  settings.jobs = 2;
  settings.options = options;
  settings.options.nearer.at_bounds = at_bounds;
  return diagnose_gap(sheet, std::move(runs), {}, settings, {});
}

TEST(Nearer, ACauseIsLikelierThanSeveralParametersAtTheirBounds) {
  const GapResult result = diagnose_scaled(2);
  EXPECT_EQ(result.verdict, "named");
  ASSERT_EQ(result.effects.size(), 1u);
  EXPECT_EQ(result.effects.front().effect, "scale");
  EXPECT_NEAR(result.effects.front().parameters.at("factor"), 1.823, 0.4);
  EXPECT_TRUE(std::any_of(result.remarks.begin(), result.remarks.end(), [](const std::string& remark) {
    return remark.find("input_gain, output_gain 3.5 tolerances from the datasheet at once") != std::string::npos;
  }));
}

// Of two causes the refit takes one, and the other is told alone.
TEST(Nearer, ParametersMayHideACauseBesideAnother) {
  const GapResult alone = diagnose_scaled(3, 0.6);
  EXPECT_EQ(alone.verdict, "named");
  ASSERT_EQ(alone.effects.size(), 1u) << alone.sentence;
  EXPECT_EQ(alone.effects.front().effect, "deadband");
  const GapResult result = diagnose_scaled(2, 0.6);
  EXPECT_EQ(result.verdict, "named");
  ASSERT_EQ(result.effects.size(), 2u) << result.sentence;
  for (const NamedEffect& effect : result.effects) EXPECT_TRUE(effect.effect == "deadband" || effect.effect == "scale");
  EXPECT_TRUE(std::any_of(result.remarks.begin(), result.remarks.end(), [](const std::string& remark) {
    return remark.find("a refit with fewer causes explains what it does only with input_gain, output_gain") == 0;
  }));
}

// At bounds that lie no nearer nothing is named.
TEST(Nearer, IsAskedOnceMoreAtBoundsWithinWhichMostRigsLie) {
  GapOptions options;
  options.linearisation.parameter_bound_tolerances = 5;
  options.nearer.bound_tolerances = options.nearer.nearest_tolerances = 5;
  const GapResult silent = diagnose_scaled(2, 0, 2.252, options);
  EXPECT_EQ(silent.verdict, "miscalibrated");
  options.nearer.nearest_tolerances = 1;
  const GapResult result = diagnose_scaled(2, 0, 2.252, options);
  EXPECT_EQ(result.verdict, "named");
  ASSERT_EQ(result.effects.size(), 1u) << result.sentence;
  EXPECT_EQ(result.effects.front().effect, "scale");
}

TEST(Nearer, IsNotAskedOfFewerParametersAtTheirBounds) {
  const GapResult result = diagnose_scaled(3);
  EXPECT_EQ(result.verdict, "miscalibrated");
  EXPECT_TRUE(result.effects.empty());
}

TEST(NextRun, ThatCannotBeSimulatedIsARemark) {
  Datasheet sheet = two_gains();
  Profile profile;
  profile.name = "loop";
  profile.controller = "nobody";
  profile.shape = "steps";
  profile.duration = 20;
  sheet.profiles = {profile};
  std::vector<std::string> remarks;
  const ModelChange nominal{sheet.nominal(), {}};
  EXPECT_TRUE(separating_runs(sheet, nominal, nominal, "a and b", GapOptions(), 1, remarks).empty());
  ASSERT_EQ(remarks.size(), 1u);
  EXPECT_NE(remarks.front().find("loop was not tried"), std::string::npos) << remarks.front();
}

// Which of the two gains is off their tolerances say; the valley in which the product stays is bent.
TEST(Rivals, TolerancesDecideAlongARidge) {
  const Datasheet sheet = two_gains();
  std::vector<SegmentedRun> runs;
  runs.push_back(cut_run(sheet, "run", two_gains_run(2.6, 0.2, 40, 5), 1));
  const ResidualModel residuals(sheet, std::move(runs));
  ModelChange start;
  start.parameters = {1.3, 2, 0.2};
  const Linearisation linear(residuals, start, {0}, 1, {}, Differences::central);
  const std::vector<double> p = fit_gap(residuals, start, {}, linear, 8).model.parameters;
  EXPECT_NEAR(p[0] * p[1], 2.6, 0.01);
  double least = kInfinity;
  const auto deviation = [](double a, double b) {
    return 0.5 * (std::pow((a - 1) / 0.1, 2) + std::pow((b - 2) / 0.6, 2));
  };
  for (double a = 0.9; a < 1.4; a += 1e-3) least = std::min(least, deviation(a, 2.6 / a));
  EXPECT_LT(deviation(p[0], p[1]), least + 0.1) << p[0] << " " << p[1];
}

}  // namespace
}  // namespace faultline
