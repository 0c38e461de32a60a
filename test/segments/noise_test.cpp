// Noise of readings beside motion that is as fast as the samples.
#include <gtest/gtest.h>

#include "faultline/segments/segment_model.h"
#include "rigs/servo_actuator/runs.h"
#include "sliding_mass.h"

namespace faultline {
namespace {

std::vector<SegmentedRun> runs_of(int held, double spring) {
  std::vector<SegmentedRun> runs;
  for (const std::uint64_t seed : {1, 2})
    runs.push_back(cut_run(sliding_mass(), "run",
                           sliding_mass_run(
                               20, seed, [=](double x, double) { return spring * x; }, held),
                           0.5));
  return runs;
}

TEST(Noise, IsWhatTheModelLeavesOfFastMotion) {
  const Datasheet sheet = sliding_mass();
  std::vector<SegmentedRun> runs = runs_of(1, 0);
  EXPECT_GT(noise_of(sheet, runs)[1], 0.05);  // steps of the force move the mass in every sample
  const std::vector<double> noise = place_all(SegmentModel(sheet), runs);
  EXPECT_NEAR(noise[0], 1e-4, 1e-5);
  EXPECT_NEAR(noise[1], 1e-3, 1e-4);
}

// A spring that is a tenth too soft.
TEST(Noise, IsNearWhereTheModelIsOff) {
  std::vector<SegmentedRun> runs = runs_of(1, 10);
  const std::vector<double> noise = place_all(SegmentModel(sliding_mass()), runs);
  EXPECT_LT(noise[0], 2e-4);
  EXPECT_LT(noise[1], 2e-3);
}

TEST(Noise, IsTheReadingsOwnWhereMotionIsSlow) {
  const Datasheet sheet = sliding_mass();
  std::vector<SegmentedRun> runs = runs_of(40, 10);
  const std::vector<double> own = noise_of(sheet, runs);
  EXPECT_EQ(place_all(SegmentModel(sheet), runs), own);
}

// An excitation that changes with every sample is no noise of its transducer: smoothed, it would be gone.
TEST(Noise, OfAMeasuredInputIsNotItsMotion) {
  Datasheet sheet = sliding_mass();
  Channel& force = sheet.channels.front();
  force.role = Role::input;
  force.noise_std = 0.01;
  Recording recording = sliding_mass_run(
      20, 1, [](double, double) { return 0; }, 1);
  recording.channels = sheet.channels;
  const SegmentedRun run = cut_run(sheet, "run", recording, 0.5);
  EXPECT_LT(run.input_noise.front(), 0.02);
  double most = 0;
  for (std::size_t k = 0; k < run.recording.rows(); ++k)
    most = std::max(most, std::abs(run.recording.at(k, 0) - recording.at(k, 0)));
  EXPECT_EQ(most, 0);
}

}  // namespace
}  // namespace faultline
