// What the noise of measured inputs pretends: on a cylinder that is driven by measured pump speeds, soft chambers.
#include "faultline/gap/input_noise.h"

#include <gtest/gtest.h>

#include <cmath>

#include "faultline/gap/effect_search.h"
#include "rigs/pump_cylinder/runs.h"

namespace faultline {
namespace {

constexpr double kSegment = 0.5;  // s

// All channels have so many times the datasheet's noise.
Datasheet noisy(double times) {
  Datasheet sheet = cylinder();
  for (Channel& channel : sheet.channels) channel.noise_std *= times;
  return sheet;
}

// `rig`: its channels have the noise of the rig, `sheet` what it is taken for.
std::vector<SegmentedRun> runs_with(const Datasheet& sheet, const std::vector<std::string>& effects,
                                    const Datasheet& rig) {
  std::vector<SegmentedRun> runs;
  std::uint64_t seed = 5;
  for (const char* profile : {"multisine", "steps"})
    runs.push_back(cut_run(sheet, profile, simulate(rig, cylinder_setup(profile, effects, seed++), 8), kSegment));
  return runs;
}

const std::vector<Fold> kFolds = {{{0}, {1}}, {{1}, {0}}};
const GapProgress kSilent;

struct Gains {
  double won = 0, by_noise = 0;
};

// Of one effect as it is given, beside the datasheet's model.
Gains gains(double times, const std::vector<std::string>& on_the_rig, const std::string& tried, double quiet = 1) {
  const Datasheet sheet = noisy(times);
  GapSettings settings;
  settings.jobs = 2;
  for (const Port& port : sheet.ports)
    for (const FittingEffect& fitting : port.effects)
      if (const std::string key = fitting.effect + "@" + port.name; key != tried) settings.without.push_back(key);
  GapTrials work(sheet, runs_with(sheet, on_the_rig, noisy(times * quiet)), kFolds, {0, 1}, settings, kSilent);
  ModelChange nominal;
  nominal.parameters = sheet.nominal();
  const FitResult base = work.stand(nominal);
  std::vector<Structure> structures = work.screen(base, 0, 1);
  EXPECT_EQ(structures.size(), 1u);
  work.refine(structures, 0, 1);
  return {work.learned_gain(structures.front()), work.gain_of_input_noise(base, structures.front())};
}

TEST(InputNoise, IsPutOnMeasuredInputsOnceMore) {
  const Datasheet sheet = noisy(5);
  ResidualModel residuals(sheet, runs_with(sheet, {}, sheet));
  const SegmentedRun& before = residuals.runs().front();
  ASSERT_TRUE(has_noisy_inputs(residuals.runs()));
  const ResidualModel again = with_input_noise(residuals, 1);
  const SegmentedRun& after = again.runs().front();
  for (const char* name : {"pump1_speed", "pump2_speed"}) {
    const auto c = static_cast<std::size_t>(sheet.channel(name));
    EXPECT_NEAR(before.input_noise[c], sheet.channels[c].noise_std, 0.1 * sheet.channels[c].noise_std);
    double square = 0;
    for (std::size_t k = 0; k < before.recording.rows(); ++k)
      square += std::pow(after.recording.at(k, c) - before.recording.at(k, c), 2);
    const double rms = std::sqrt(square / static_cast<double>(before.recording.rows()));
    EXPECT_GT(rms, 0.1 * before.input_noise[c]);
    EXPECT_LT(rms, 1.1 * before.input_noise[c]);
  }
  for (const char* name : {"position", "chamber_a_pressure", "pump1_speed_command"}) {
    const auto c = static_cast<std::size_t>(sheet.channel(name));
    EXPECT_EQ(before.input_noise[c], 0);
    for (std::size_t k = 0; k < before.recording.rows(); ++k)
      ASSERT_EQ(before.recording.at(k, c), after.recording.at(k, c));
  }
}

// Nothing is wrong with the rig, but softer oil makes less of the noise that the measured speeds have.
TEST(InputNoise, GivesASoftChamberWhatItWins) {
  const Gains soft = gains(5, {}, "compliance_factor@compliance.chamber_b");
  EXPECT_GT(soft.won, 50);
  EXPECT_GT(soft.by_noise, 0.2 * soft.won);
}

TEST(InputNoise, GivesNothingToWhatTheRigHas) {
  const Gains scale = gains(5, {"scale@sensor.chamber_a_pressure:factor=0.8"}, "scale@sensor.chamber_a_pressure");
  EXPECT_GT(scale.won, 50);
  EXPECT_LT(scale.by_noise, -0.5 * scale.won);
  // Beside transducers that are far better than their datasheet, too: its noise is not theirs.
  const Gains quiet =
      gains(1, {"scale@sensor.chamber_a_pressure:factor=0.97"}, "scale@sensor.chamber_a_pressure", 0.05);
  EXPECT_GT(quiet.won, 50);
  EXPECT_LT(quiet.by_noise, -0.7 * quiet.won);
  const Gains soft =
      gains(0.2, {"compliance_factor@compliance.chamber_b:factor=0.3"}, "compliance_factor@compliance.chamber_b");
  EXPECT_GT(soft.won, 50);
  EXPECT_LT(soft.by_noise, -0.5 * soft.won);
}

}  // namespace
}  // namespace faultline
