// Runs of two rigs are told from runs of one, whatever else the model lacks.
#include "faultline/gap/run_agreement.h"

#include <gtest/gtest.h>

#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

enum class Known { no, yes };

// `known`: the model has the effect that the runs have.
std::string said_of(const std::vector<double>& frictions, const char* effect = nullptr, Known known = Known::no) {
  const auto coulomb = static_cast<std::size_t>(servo().parameter("coulomb_friction"));
  std::vector<SegmentedRun> runs;
  std::uint64_t seed = 3;
  for (const double friction : frictions) {
    SimulationSetup setup = servo_setup("multisine", seed++);
    setup.parameters = servo().nominal();
    setup.parameters[coulomb] = friction;
    if (effect) setup.effects.push_back(parse_effect(effect));
    runs.push_back(cut_run(servo(), "run " + std::to_string(runs.size() + 1), simulate(servo(), setup, 6), 0.25));
  }
  ResidualModel residuals(servo(), runs);
  FitResult at;
  at.model.parameters = servo().nominal();
  at.model.parameters[coulomb] = 0.5 * (frictions.front() + frictions.back());
  if (known == Known::yes) {
    at.effects.resize(1);
    at.effects.front().effect = parse_effect(effect);
    at.effects.front().bounds.push_back({0, 1});
    at.model = with_effects(at.effects, at.model.parameters);
    for (std::size_t r = 0; r < runs.size(); ++r) residuals.settle_starts(at.model, r);
  }
  const Linearisation linear(residuals, at.model, {0, 1}, 1);
  return disagreement(residuals, linear, at, 1);
}

TEST(RunAgreement, NamesTheParameterInWhichTwoRunsDiffer) {
  const double nominal = servo().nominal()[static_cast<std::size_t>(servo().parameter("coulomb_friction"))];
  const std::string text = said_of({nominal, 1.3 * nominal});
  EXPECT_NE(text.find("coulomb_friction"), std::string::npos) << text;
  EXPECT_NE(text.find("run 1"), std::string::npos) << text;
  EXPECT_NE(text.find("run 2"), std::string::npos) << text;
}

// What both runs have keeps them from being told apart, unless the model has it, too.
TEST(RunAgreement, NamesTheParameterBesideAnEffectThatBothHave) {
  const double nominal = servo().nominal()[static_cast<std::size_t>(servo().parameter("coulomb_friction"))];
  const char* const play = "backlash@transmission.rod:gap=1e-3";
  EXPECT_NE(said_of({nominal, 1.3 * nominal}, play, Known::yes).find("coulomb_friction"), std::string::npos);
  EXPECT_EQ(said_of({nominal, nominal}, play, Known::yes), "");
}

TEST(RunAgreement, SaysNothingOfRunsOfOneRig) {
  const double nominal = servo().nominal()[static_cast<std::size_t>(servo().parameter("coulomb_friction"))];
  EXPECT_EQ(said_of({nominal, nominal}), "");
  EXPECT_EQ(said_of({nominal, nominal}, "orifice_leakage@flow.chamber_a_tank:coefficient=3e-9"), "");
}

}  // namespace
}  // namespace faultline
