// Any rig as filters see it: its derivatives, its noise against what healthy runs show, readings that say nothing.
#include <cmath>

#include <gtest/gtest.h>

#include "../estimators/jacobians.h"
#include "count_allocations.h"
#include "faultline/estimators/estimator_stage.h"
#include "faultline/rig/simulator.h"
#include "own_rigs.h"

namespace faultline {
namespace {

std::unique_ptr<ProcessModel> model_of(const Datasheet& sheet) {
  return make_process_model("rig_model", sheet, Settings("test", {}, {}, {}));
}

Recording healthy_run(const Datasheet& sheet, std::uint64_t seed, bool off_nominal, const std::string& profile) {
  SimulationSetup setup;
  setup.profile = profile;
  setup.seed = seed;
  if (off_nominal) setup.parameters = draw_parameters(sheet, seed);
  return simulate(sheet, setup, sheet.profile(profile).duration);
}

struct Watched {
  double mean_square = 0;  // normalised innovation squared per row, after the first fifth
  int restarts = 0;
};

template <class Look>
Watched run_filter(const Datasheet& sheet, const std::string& type, const Recording& run, Look&& look) {
  EstimatorStage stage(sheet, {"filter", type, Settings("test", {}, {}, {{"model", "rig_model"}})});
  Estimate estimate;
  Watched watched;
  double count = 0;
  for (std::size_t row = 0; row < run.rows(); ++row) {
    EXPECT_TRUE(stage.process(run.sample(row), estimate));
    watched.restarts += estimate.restarted;
    if (row < run.rows() / 5 || estimate.observed == 0) continue;
    watched.mean_square += estimate.normalised_innovation / estimate.observed;
    ++count;
    look(row, estimate);
  }
  watched.mean_square /= count;
  return watched;
}

class OwnRigModel : public ::testing::TestWithParam<std::string> {};

TEST_P(OwnRigModel, JacobianIsThatOfItsPrediction) {
  const Datasheet sheet = own_rig(GetParam());
  const auto model = model_of(sheet);
  const Recording run = healthy_run(sheet, 1, false, "steps");
  std::vector<double> state(sheet.states.size()), variance(state.size()), scale;
  model->initial(run.row(0), state.data(), variance.data());
  model->take_inputs(run.row(0));
  for (std::size_t i = 0; i < state.size(); ++i) {
    scale.push_back(std::max(std::abs(state[i]), std::sqrt(variance[i])));
    state[i] += 0.05 * scale[i];
  }
  EXPECT_LT(worst_entry(*model, state, scale, sheet.sample_period), 1e-4);
}

TEST_P(OwnRigModel, AStepAllocatesNothing) {
  const Datasheet sheet = own_rig(GetParam());
  const Recording run = healthy_run(sheet, 1, false, "steps");
  for (const char* type : {"extended_kalman", "unscented_kalman", "divided_difference_2"}) {
    EstimatorStage stage(sheet, {"filter", type, Settings("test", {}, {}, {{"model", "rig_model"}})});
    Estimate estimate;
    std::uint64_t before = 0;
    Sample sample = run.sample(0);
    for (std::size_t row = 0; row < 100; ++row) {
      sample.time = run.time[row];
      std::copy_n(run.row(row), run.columns(), sample.values.begin());
      if (row == 10) before = allocations();
      stage.process(sample, estimate);
    }
    EXPECT_EQ(allocations(), before) << type;
  }
}

// One is what a filter expects of itself; below, it takes tolerances into account that this rig does not have.
TEST_P(OwnRigModel, InnovationsOfHealthyRigsAreNoLargerThanItSays) {
  const Datasheet sheet = own_rig(GetParam());
  for (const char* type : {"extended_kalman", "unscented_kalman", "divided_difference_2"})
    for (std::uint64_t seed = 1; seed <= 3; ++seed)
      for (const bool off_nominal : {false, true}) {
        const Recording run = healthy_run(sheet, seed, off_nominal, "steps");
        const Watched watched = run_filter(sheet, type, run, [](std::size_t, const Estimate&) {});
        EXPECT_LT(watched.mean_square, 1.5) << type << " " << seed << " " << off_nominal;
        EXPECT_GT(watched.mean_square, 0.5) << type << " " << seed << " " << off_nominal;
        EXPECT_EQ(watched.restarts, 1);
      }
}

INSTANTIATE_TEST_SUITE_P(Rigs, OwnRigModel, ::testing::Values("two_tanks", "fast_valve"));

// The level that nothing measures against the truth, which two tanks of the same kind show where the first is measured.
TEST(RigModel, EstimatesWhatIsNotMeasured) {
  const Datasheet sheet = own_rig("two_tanks");
  const Recording run = healthy_run(sheet, 5, false, "steps");
  // The truth: the same commands without noise, the upper level from its own balance.
  double upper = std::pow(8e-6 * run.at(0, 0) / 2.4e-5, 2) / (2 * 9.81);
  std::vector<double> truth;
  for (std::size_t row = 0; row < run.rows(); ++row) {
    truth.push_back(upper);
    for (int i = 0; i < 4000; ++i)
      upper += 1e-3 * (8e-6 * run.at(row, 0) - 2.4e-5 * std::sqrt(2 * 9.81 * upper)) / 0.012;
  }
  double square = 0, sigmas = 0, count = 0;
  run_filter(sheet, "unscented_kalman", run, [&](std::size_t row, const Estimate& estimate) {
    const double off = estimate.state[0] - truth[row];
    square += off * off;
    sigmas += off * off / estimate.covariance[0];
    ++count;
  });
  EXPECT_LT(std::sqrt(square / count), 0.005);  // m, of levels up to 0.36
  EXPECT_LT(sigmas / count, 2);
}

TEST(RigModel, FindsALevelThatItBeganWithWrongly) {
  const Datasheet sheet = own_rig("two_tanks");
  Recording run = healthy_run(sheet, 5, false, "steps");
  run.values[0] = 8;  // a first command that had not acted yet: the rig's own start is then far off
  double first = 0, last = 0;
  EstimatorStage stage(sheet, sheet.estimators[0]);
  Estimate estimate;
  for (std::size_t row = 0; row < 100; ++row) {
    stage.process(run.sample(row), estimate);
    if (row == 0) first = std::sqrt(estimate.covariance[0]);
    last = std::sqrt(estimate.covariance[0]);
  }
  EXPECT_GT(first, 0.1);  // m: it knew that it did not know
  EXPECT_LT(last, 0.1 * first);
}

TEST(RigModel, AReadingAtTheEndOfItsRangeIsLeftOut) {
  const Datasheet sheet = own_rig("two_tanks");
  Recording run = healthy_run(sheet, 1, false, "steps");
  EstimatorStage stage(sheet, sheet.estimators[0]);
  Estimate estimate;
  for (std::size_t row = 0; row < 60; ++row) {
    Sample sample = run.sample(row);
    if (row >= 50) sample.values[1] = sheet.channels[1].maximum;
    stage.process(sample, estimate);
    EXPECT_EQ(estimate.observed, row == 0 || row >= 50 ? 0 : 1) << row;
  }
  EXPECT_LT(estimate.state[1], 0.39);  // it was not drawn to the end
}

TEST(RigModel, RefusesARigThatItCannotWatch) {
  Datasheet sheet = own_rig("two_tanks");
  for (Channel& channel : sheet.channels)
    if (channel.role == Role::output) channel.ground_truth = true;
  EXPECT_THROW(model_of(sheet), std::exception);
}

}  // namespace
}  // namespace faultline
