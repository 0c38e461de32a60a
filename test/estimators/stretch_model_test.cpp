// What a stretch of a healthy valve leaves beside the model that made it: starts at a stop, memories of force loops.
#include "faultline/estimators/stretch_model.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "rigs/control_valve/runs.h"

namespace faultline {
namespace {

struct Left {
  double beyond_noise = 0;  // StretchModel::beyond_noise, of all stretches
  double largest = 0;       // mean square of an output over a stretch, in variances
};

// Of stretches of 9 s every 20 s, with the parameters and the small effects of the rig that was recorded.
Left left_of(const Datasheet& sheet, const SimulationSetup& setup, double duration) {
  const Recording recording = simulate(valve(), setup, duration);
  ResponseSettings settings;
  settings.segment_s = 2.28;
  settings.segments = 3;
  const StretchModel model(sheet, settings);
  ModelPoint point = model.nominal();
  point.parameters = setup.parameters;
  point.effects = setup.effects;
  const auto rows = static_cast<std::size_t>(settings.stretch_s() / sheet.sample_period) + 1;
  Left left;
  for (std::size_t first = 600; first + rows < recording.rows(); first += 2000) {
    Recording piece;
    piece.rig = recording.rig;
    piece.channels = recording.channels;
    for (std::size_t k = first; k < first + rows; ++k) piece.append(recording.sample(k));
    const auto stretch = model.prepare(piece);
    model.respond(*stretch, point);
    for (const SegmentResponse& segment : stretch->segments) left.beyond_noise += model.beyond_noise(segment.residuals);
    const auto n = static_cast<Eigen::Index>(model.segment_rows());
    for (Eigen::Index o = 0; o < static_cast<Eigen::Index>(model.outputs()); ++o) {
      double squares = 0;
      for (const SegmentResponse& segment : stretch->segments)
        squares += segment.residuals.segment(o * n, n).squaredNorm();
      left.largest = std::max(left.largest, squares / static_cast<double>(n * 3));
    }
  }
  return left;
}

// Without a loop the valve stands at its stops, where its linkage has used up its play, and its spool within friction.
TEST(StretchModel, TheModelThatMadeARunExplainsIt) {
  for (const char* profile : {"open_steps", "open_ramps", "open_multisine", "paper"})
    EXPECT_LT(left_of(valve(), off_nominal_valve(profile, 95027), 240).largest, 5) << profile;
}

// A datasheet that does not know of the loop does not know of its memory either.
TEST(StretchModel, AForceLoopsMemoryIsAStartState) {
  Datasheet without = valve();
  without.nuisance.erase(std::remove_if(without.nuisance.begin(), without.nuisance.end(),
                                        [](const std::string& text) { return text.rfind("hysteresis@force", 0) == 0; }),
                         without.nuisance.end());
  ASSERT_LT(without.nuisance.size(), valve().nuisance.size());
  const SimulationSetup setup = off_nominal_valve("open_steps", 95027);
  EXPECT_LT(left_of(valve(), setup, 120).beyond_noise, 0.6 * left_of(without, setup, 120).beyond_noise);
}

}  // namespace
}  // namespace faultline
