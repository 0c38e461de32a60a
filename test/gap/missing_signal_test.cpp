// What "unknown" shows: the place, what the missing signal is a function of, and a curve that closes the gap.
#include "faultline/gap/missing_signal.h"

#include <gtest/gtest.h>

#include <cmath>

#include "faultline/gap/diagnose_gap.h"
#include "faultline/gap/gap_trials.h"
#include "sliding_mass.h"

namespace faultline {
namespace {

using Law = std::function<double(double x, double v)>;

double nothing(double, double) { return 0; }
double cubic(double x, double) { return 400 * x * x * x; }
double stribeck(double, double v) { return (5 + 5 * std::exp(-std::abs(v) / 0.2)) * std::tanh(v / 0.01); }

std::vector<SegmentedRun> runs_of(const Datasheet& sheet, const Law& law, std::uint64_t seed) {
  std::vector<SegmentedRun> runs;
  for (std::uint64_t k = 0; k < 2; ++k)
    runs.push_back(cut_run(sheet, "run " + std::to_string(k), sliding_mass_run(20, seed + k, law), 0.5));
  return runs;
}

GapResult diagnose(const Datasheet& sheet, const Law& law, std::uint64_t seed) {
  GapSettings settings;
  settings.jobs = 2;
  return diagnose_gap(sheet, runs_of(sheet, law, seed), {}, settings, {});
}

// Mean squared residual over segments beyond the noise, in noise variances.
double excess(const Datasheet& sheet, const Law& law, std::uint64_t seed) {
  const ResidualModel model(sheet, runs_of(sheet, law, seed));
  double squares = 0, count = 0;
  for (std::size_t r = 0; r < 2; ++r) {
    const Eigen::MatrixXf residuals = model.residuals({sheet.nominal(), {}}, r);
    squares += residuals.squaredNorm();
    count += static_cast<double>(residuals.size());
  }
  return squares / count - 1;
}

// As --adopt writes it and --config reads it.
TEST(MissingSignal, CurvesAreReadFromADatasheet) {
  SignalCurve curve;
  curve.passes = 1;
  curve.at = CurveGrid(-2, 3).nodes();
  curve.value.fill(1.5);
  const std::string text = to_string(curve_effect("force.mass", curve));
  const Datasheet read = sliding_mass("nominal_effects: [\"" + text + "\"]\n");
  EXPECT_EQ(read.nominal_effects, std::vector<std::string>{text});
  EXPECT_EQ(parse_effect(text).parameters.back(), 1.5);
}

Datasheet adopted(Datasheet sheet, const MissingSignal& missing) {
  for (std::size_t p = 0; p < sheet.parameters.size(); ++p) sheet.parameters[p].nominal = missing.parameters[p];
  sheet.nominal_effects.push_back(to_string(curve_effect(missing.port, *missing.adoptable)));
  return sheet;
}

TEST(MissingSignal, OfASpringIsAFunctionOfThePosition) {
  const Datasheet sheet = sliding_mass();
  const GapResult result = diagnose(sheet, cubic, 11);
  ASSERT_EQ(result.verdict, "unknown") << result.sentence;
  ASSERT_TRUE(result.missing);
  const MissingSignal& missing = *result.missing;
  EXPECT_EQ(missing.port, "force.mass");
  EXPECT_EQ(missing.unit, "N");
  EXPECT_NE(missing.formula.find("position^3"), std::string::npos) << missing.formula;
  EXPECT_EQ(missing.formula.find("velocity"), std::string::npos) << missing.formula;
  EXPECT_GT(missing.score, 0.8);
  ASSERT_TRUE(missing.adoptable);
  EXPECT_EQ(missing.adoptable->variable, "position");
  EXPECT_GT(missing.adopted_shrink, 0.8);
  EXPECT_LT(excess(adopted(sheet, missing), cubic, 21), 0.2 * excess(sheet, cubic, 21));
  // Curve and refitted spring together, over the refitted mass: the two trade with each other.
  const CurveGrid grid(missing.adoptable->at.front(), missing.adoptable->at.back());
  const double mass = missing.parameters[0], stiffness = missing.parameters[3];
  for (double x = -0.5; x < 0.51; x += 0.1)
    EXPECT_NEAR(sheet.parameters[0].nominal / mass * (grid.value(missing.adoptable->value, x) + stiffness * x),
                cubic(x, 0) + sheet.parameters[3].nominal * x, 6)
        << x;
}

TEST(MissingSignal, OfFrictionIsAFunctionOfTheVelocity) {
  const Datasheet sheet = sliding_mass();
  const GapResult result = diagnose(sheet, stribeck, 12);
  ASSERT_EQ(result.verdict, "unknown") << result.sentence;
  ASSERT_TRUE(result.missing);
  const MissingSignal& missing = *result.missing;
  EXPECT_EQ(missing.port, "force.mass");
  EXPECT_NE(missing.formula.find("tanh(velocity"), std::string::npos) << missing.formula;
  EXPECT_GT(missing.score, 0.5);
  ASSERT_TRUE(missing.adoptable);
  EXPECT_EQ(missing.adoptable->variable, "velocity");
  EXPECT_LT(excess(adopted(sheet, missing), stribeck, 22), 0.5 * excess(sheet, stribeck, 22));
}

TEST(MissingSignal, IsNoFunctionWhereNothingIsMissing) {
  const Datasheet sheet = sliding_mass();
  EXPECT_FALSE(diagnose(sheet, nothing, 13).missing);
  const ResidualModel residuals(sheet, runs_of(sheet, nothing, 13));
  FreePlace place;
  place.port = "force.mass";
  place.level = 0.5;
  place.memory = 0.1;
  const MissingSignal missing =
      find_missing_signal(residuals, {sheet.nominal(), {}}, place, {{{0}, {1}}, {{1}, {0}}}, 2);
  EXPECT_EQ(missing.formula, "");
  EXPECT_FALSE(missing.curve);
  EXPECT_LT(missing.score, 0.3);
}

}  // namespace
}  // namespace faultline
