// What a drive makes of its command shows in the measured speed alone, which drives the hydraulics all the same: fits,
// gap and the response isolator hold it against what the model makes of the command.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "faultline/segments/segment_model.h"
#include "rigs/pump_cylinder/runs.h"

namespace faultline {
namespace {

// RMS of the residuals of a channel over its noise, for a run with effects held against a model with others.
float rest(const std::vector<std::string>& of_run, const std::vector<std::string>& of_model, const char* channel) {
  SegmentedRun run =
      cut_run(cylinder(), "run", simulate(cylinder(), cylinder_setup("varied_steps", of_run, 4), 6), 0.5);
  const SegmentModel model(cylinder());
  const std::vector<double> noise = noise_of(cylinder(), {run});
  ModelChange change = model.nominal();
  for (const std::string& effect : of_model) change.effects.push_back(parse_effect(effect));
  model.place_starts(run, noise, change);
  const auto output = std::find(model.outputs().begin(), model.outputs().end(), cylinder().channel(channel));
  if (output == model.outputs().end()) return -1;
  const Eigen::MatrixXf r = model.residuals(change, run, noise);
  return std::sqrt(r.col(output - model.outputs().begin()).squaredNorm() / static_cast<float>(r.rows()));
}

TEST(Drive, NoiseIsTheTransducersNotTheCommands) {
  const SegmentedRun run =
      cut_run(cylinder(), "run", simulate(cylinder(), cylinder_setup("varied_steps", {}, 4), 6), 0.5);
  const std::vector<int> outputs = compared_outputs(cylinder());
  const std::vector<double> noise = noise_of(cylinder(), {run});
  for (const char* channel : {"pump1_speed", "pump2_speed"}) {
    const auto output = std::find(outputs.begin(), outputs.end(), cylinder().channel(channel));
    ASSERT_NE(output, outputs.end());
    EXPECT_NEAR(noise[static_cast<std::size_t>(output - outputs.begin())], 0.3, 0.02) << channel;
  }
}

TEST(Drive, EffectsShowInTheMeasuredSpeedAndAreExplained) {
  EXPECT_NEAR(rest({}, {}, "pump2_speed"), 1, 0.1);
  for (const char* effect : {"scale@command.pump2_speed:factor=0.94", "lag@command.pump2_speed:time_constant=0.008",
                             "deadband@command.pump2_speed:width=4", "offset@sensor.pump2_speed:value=0.8"}) {
    EXPECT_GT(rest({effect}, {}, "pump2_speed"), 1.3) << effect;
    EXPECT_NEAR(rest({effect}, {effect}, "pump2_speed"), 1, 0.1) << effect;
    EXPECT_NEAR(rest({effect}, {}, "pump1_speed"), 1, 0.1) << effect;
  }
}

}  // namespace
}  // namespace faultline
