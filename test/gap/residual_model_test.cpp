// Residuals of a gap, rounding that is found in recordings, and the course that is written for plots.
#include "faultline/gap/residual_model.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "faultline/gap/gap_series.h"
#include "faultline/gap/rounded_channels.h"
#include "faultline/numerics/random.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

constexpr double kSegment = 0.5;  // s

ModelChange nominal() {
  ModelChange model;
  model.parameters = servo().nominal();
  return model;
}

// A stuck transducer's value is read from the recording, and the state behind it goes on: otherwise each segment
// would start at what it shows.
TEST(Residuals, OfAStuckTransducerAreNoiseOnceItIsInTheModel) {
  SimulationSetup setup = servo_setup("multisine");
  const std::string stuck = "stuck@sensor.position:from=2.1";
  setup.effects = {parse_effect(stuck)};
  const ResidualModel residuals(servo(), {cut_run(servo(), "a.bag", simulate(servo(), setup, 6), 0.25)});
  const auto position =
      std::find(residuals.outputs().begin(), residuals.outputs().end(), static_cast<int>(column("position"))) -
      residuals.outputs().begin();
  const auto mean_square = [&](const ModelChange& model) {
    const Eigen::VectorXf held = residuals.residuals(model, 0).col(position).tail(3500);
    return static_cast<double>(held.squaredNorm()) / 3500;
  };
  ModelChange model = nominal();
  EXPECT_GT(mean_square(model), 10);
  model.effects = {parse_effect(stuck)};
  EXPECT_LT(mean_square(model), 1.2);
}

// Where parts of a run are simulated, each holds what the run held when it stuck.
TEST(Residuals, OfWhatIsStuckAreNoiseInPartsOfARunToo) {
  for (const std::string stuck : {"stuck@sensor.load_pressure:from=2.1", "stuck@command.valve_command:from=2.1"}) {
    SimulationSetup setup = servo_setup("multisine");
    setup.effects = {parse_effect(stuck)};
    const ResidualModel whole(servo(), {cut_run(servo(), "a.bag", simulate(servo(), setup, 6), 0.25)});
    const ResidualModel residuals = whole.part({{2, 3, 12, 13, 18, 21}});
    ModelChange model = nominal();
    model.effects = {parse_effect(stuck)};
    const Eigen::MatrixXf r = residuals.residuals(model, 0);
    const SegmentedRun& run = residuals.runs()[0];
    ASSERT_EQ(run.segments(), 6u);
    for (const std::size_t row : run.restarts) {
      const Eigen::MatrixXf segment =
          r.middleRows(static_cast<Eigen::Index>(row) + 1, static_cast<Eigen::Index>(run.segment) - 1);
      EXPECT_LT(segment.squaredNorm() / static_cast<float>(segment.size()), 2.0F) << stuck << " " << row;
    }
  }
}

TEST(ResidualModel, IsNoiseWhereTheModelIsRightAndMoreWhereItIsNot) {
  SimulationSetup other = servo_setup("prbs", 2);
  other.effects.push_back(parse_effect("viscous_friction@force.piston:coefficient=800"));
  std::vector<SegmentedRun> runs;
  runs.push_back(cut_run(servo(), "right", simulate(servo(), servo_setup("multisine"), 3), kSegment));
  runs.push_back(cut_run(servo(), "wrong", simulate(servo(), other, 3), kSegment));
  const ResidualModel model(servo(), std::move(runs));
  ASSERT_EQ(model.outputs().size(), 6u);
  const auto mean_square = [&](std::size_t run, std::size_t horizon) {
    const Eigen::MatrixXf r =
        horizon == 0 ? settled_residuals(model, nominal(), run) : model.residuals(nominal(), run, horizon);
    return static_cast<double>(r.squaredNorm()) / static_cast<double>(r.size());
  };
  // The noise in the samples from which a segment starts is not taken for a gap.
  EXPECT_NEAR(mean_square(0, 0), 1, 0.1);
  EXPECT_GT(mean_square(1, 0), 20);
  EXPECT_LT(mean_square(1, 1), mean_square(1, 0));
  EXPECT_EQ(model.start_sensitivity(nominal(), 0).size(), 5u);  // position, velocity, both chambers, spool
}

TEST(ResidualModel, StartStatesSettleWhereTheyFitBest) {
  // A start that is put off by five deviations comes back, and the loss with it.
  ResidualModel model(servo(), {cut_run(servo(), "a", simulate(servo(), servo_setup("prbs"), 3), kSegment)});
  const auto shifted = [&] {
    double sum = 0;
    for (const Eigen::VectorXd& shift : model.runs()[0].start_shift) sum += shift.squaredNorm();
    return sum;
  };
  const auto loss = [&] {
    return 0.5 * static_cast<double>(model.residuals(nominal(), 0).squaredNorm()) + 0.5 * shifted();
  };
  EXPECT_EQ(shifted(), 0);
  const double before = loss();
  model.settle_starts(nominal(), 0);
  const double once = loss();
  model.settle_starts(nominal(), 0);
  const double twice = loss();
  EXPECT_LT(once, before);
  EXPECT_LE(twice, once);
  // About one squared unit of noise per value is left: the model is right.
  EXPECT_NEAR(2 * twice / (3000 * 6), 1, 0.06);
  EXPECT_GT(shifted(), 1);
}

TEST(RoundedChannels, AreThoseOnACoarseGrid) {
  const auto position = static_cast<std::size_t>(servo().channel("position"));
  std::vector<SegmentedRun> runs;
  for (const std::uint64_t seed : {1, 2}) {
    SimulationSetup setup = servo_setup("multisine");
    setup.seed = seed;
    runs.push_back(cut_run(servo(), "a", simulate(servo(), setup, 5), kSegment));
  }
  EXPECT_TRUE(rounded_channels(ResidualModel(servo(), runs), {}).empty());
  const auto round_run = [&](SegmentedRun& run) {
    for (std::size_t k = 0; k < run.recording.rows(); ++k) {
      double& value = run.recording.values[k * run.recording.columns() + position];
      value = 5e-4 * std::round(value / 5e-4);
    }
  };
  round_run(runs[0]);
  EXPECT_TRUE(rounded_channels(ResidualModel(servo(), runs), {}).empty());  // in one run only
  round_run(runs[1]);
  const std::vector<NamedEffect> found = rounded_channels(ResidualModel(servo(), runs), {});
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].port, "sensor.position");
  EXPECT_NEAR(found[0].parameters.at("step"), 5e-4, 1e-8);
  EXPECT_TRUE(rounded_channels(ResidualModel(servo(), runs), {"quantisation"}).empty());
  // Where noise hides it, it matters to nobody.
  std::vector<SegmentedRun> noisy = runs;
  Random random(3);
  for (SegmentedRun& run : noisy)
    for (std::size_t k = 0; k < run.recording.rows(); ++k) {
      double& value = run.recording.values[k * run.recording.columns() + position];
      value += 5e-4 * std::round(random.normal());
    }
  EXPECT_TRUE(rounded_channels(ResidualModel(servo(), noisy), {}).empty());
  Datasheet adopted = servo();
  adopted.nominal_effects.push_back("quantisation@sensor.position:step=5e-4");
  EXPECT_TRUE(rounded_channels(ResidualModel(adopted, runs), {}).empty());
}

TEST(GapSeries, HoldsTheRecordingAndThreeCourses) {
  SimulationSetup setup = servo_setup("multisine");
  std::vector<SegmentedRun> runs;
  for (const char* name : {"a", "b"}) {
    setup.seed += 1;
    runs.push_back(cut_run(servo(), name, simulate(servo(), setup, 6), kSegment));
    for (double& time : runs.back().recording.time) time += 100;
  }
  const ResidualModel model(servo(), std::move(runs));
  ModelChange wrong = nominal();
  wrong.parameters[static_cast<std::size_t>(servo().parameter("viscous_damping"))] *= 1.5;
  wrong.parameters[static_cast<std::size_t>(servo().parameter("flow_coefficient"))] *= 0.8;
  const Eigen::MatrixXf bad = settled_residuals(model, wrong, 1), good = settled_residuals(model, nominal(), 1);
  EXPECT_EQ(settled_residuals(model, wrong, 1, 3), bad);  // whatever the threads
  const GapSeries series = gap_series(model, 1, {&bad, &good, &good}, 2);
  EXPECT_EQ(series.run, 1u);
  ASSERT_EQ(series.time.size(), 3001u);  // every second of 6001
  EXPECT_EQ(series.time.front(), 0);
  EXPECT_NEAR(series.time.back(), 6, 1e-9);
  ASSERT_EQ(series.channels.size(), 6u);
  ASSERT_EQ(series.values.size(), series.time.size() * 24);
  const Recording& recorded = model.runs()[1].recording;
  double off[3] = {0, 0, 0};
  for (std::size_t k = 0; k < series.time.size(); ++k)
    for (std::size_t o = 0; o < 6; ++o) {
      const double* values = series.values.data() + k * 24 + 4 * o;
      ASSERT_EQ(values[0], recorded.at(2 * k, static_cast<std::size_t>(model.outputs()[o])));
      for (int level = 0; level < 3; ++level)
        off[level] += std::pow((values[level + 1] - values[0]) / model.noise()[o], 2);
    }
  EXPECT_GT(off[0], 2 * off[1]);
  EXPECT_EQ(off[1], off[2]);
  EXPECT_LT(off[1] / static_cast<double>(6 * series.time.size()), 4);

  // The second half of a run that was cut in two: one run, and time goes on.
  const GapSeries half = gap_series(model, 1, {&bad, &good, &good}, 1);
  EXPECT_EQ(half.run, 0u);
}

}  // namespace
}  // namespace faultline
