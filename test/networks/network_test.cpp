// Networks: what a step computes, its derivatives against differences, and how training finds the weights.
#include "faultline/networks/network.h"

#include <gtest/gtest.h>

#include "allocations.h"
#include "count_allocations.h"
#include "faultline/signal/error.h"
#include "networks/networks.h"

namespace faultline {
namespace {

constexpr double kTanh = 1e-9;  // what the table of tanh leaves (numerics/quick_tanh.h)

// Largest difference of J'J and J'e from those of a Jacobian by central differences, in parts of the largest entry.
double worst(const NetworkShape& shape, const Beginnings& beginnings = {}) {
  const std::vector<NetworkRun> runs = runs_of(shape, 60, 3);
  const Eigen::VectorXd w = initial_weights(shape, 5);
  const auto errors = [&](const Eigen::VectorXd& weights) {
    Network network(shape);
    std::vector<double> all;
    const NetworkRun& run = runs.front();
    network.start(run.inputs.col(0).data(), run.outputs.col(0).data());
    for (Eigen::Index k = 1; k < run.inputs.cols(); ++k) {
      const auto since = beginnings.horizon > 0 ? (k - 1) % static_cast<Eigen::Index>(beginnings.horizon) : k - 1;
      if (since == 0 && beginnings.cold > 0)
        network.restart_cold();
      else if (since == 0 && k > 1)
        network.restart_measured();
      network.step(weights.data(), run.inputs.col(k).data());
      if (since >= static_cast<Eigen::Index>(beginnings.cold))
        for (Eigen::Index o = 0; o < 2; ++o) all.push_back(run.outputs(o, k) - network.outputs()[o]);
      network.take(run.outputs.col(k).data());
    }
    return Eigen::VectorXd(Eigen::Map<Eigen::VectorXd>(all.data(), static_cast<Eigen::Index>(all.size())));
  };
  const Eigen::VectorXd e = errors(w);
  Eigen::MatrixXd j(e.size(), w.size());
  for (Eigen::Index i = 0; i < w.size(); ++i) {
    Eigen::VectorXd plus = w, minus = w;
    plus[i] += 1e-6;
    minus[i] -= 1e-6;
    j.col(i) = (errors(minus) - errors(plus)) / 2e-6;
  }
  const NormalEquations found = normal_equations(shape, w, runs, beginnings);
  const double n = static_cast<double>(e.size()) / 2;
  const Eigen::MatrixXd square = j.transpose() * j / n;
  const Eigen::MatrixXd full = found.square.selfadjointView<Eigen::Lower>();
  EXPECT_NEAR(found.error, e.squaredNorm() / n, 1e-12);
  EXPECT_NEAR(mean_squares(shape, w, runs, beginnings).sum(), found.error, 1e-12);
  EXPECT_GT(square.diagonal().minCoeff(), 0);
  return std::max(
      (full - square).cwiseAbs().maxCoeff() / square.cwiseAbs().maxCoeff(),
      (found.gradient - j.transpose() * e / n).cwiseAbs().maxCoeff() / found.gradient.cwiseAbs().maxCoeff());
}

TEST(Network, DerivativesAgainstDifferences) {
  const Datasheet sheet = plant();
  for (const char* feedback : {"none", "own", "all"}) {
    EXPECT_LT(worst(network_shape(sheet, black_box(feedback))), 1e-7) << feedback;
    EXPECT_LT(worst(network_shape(sheet, structured(feedback))), 1e-7) << feedback;
    EXPECT_LT(worst(network_shape(sheet, structured(feedback)), {7, 0}), 1e-7) << feedback;
    EXPECT_LT(worst(network_shape(sheet, structured(feedback)), {10, 3}), 1e-7) << feedback;
  }
}

// NARX is trained hundreds of samples at a time (one_step.h): over runs longer than that and of no round length, with
// more lags than one, against sums over a network that goes sample by sample.
TEST(Network, OneStepAheadAtOnceAsSampleBySample) {
  for (const double lags : {1.0, 3.0}) {
    const NetworkShape shape = network_shape(plant(), black_box("none", lags, 4));
    std::vector<NetworkRun> runs = runs_of(shape, 700, 3);
    runs.push_back(runs_of(shape, 257, 4).front());
    runs.push_back(runs_of(shape, 2, 5).front());
    const Eigen::VectorXd w = initial_weights(shape, 5);
    Eigen::MatrixXd square = Eigen::MatrixXd::Zero(w.size(), w.size());
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(w.size());
    double error = 0, count = 0;
    Network network(shape, true);
    for (const NetworkRun& run : runs) {
      network.start(run.inputs.col(0).data(), run.outputs.col(0).data());
      for (Eigen::Index k = 1; k < run.inputs.cols(); ++k, ++count) {
        network.step(w.data(), run.inputs.col(k).data());
        for (Eigen::Index o = 0; o < 2; ++o) {
          const Eigen::VectorXd row = network.sensitivities().row(o).transpose();
          const double e = run.outputs(o, k) - network.outputs()[o];
          square += row * row.transpose();
          gradient += row * e;
          error += e * e;
        }
        network.take(run.outputs.col(k).data());
      }
    }
    const NormalEquations found = normal_equations(shape, w, runs);
    const Eigen::MatrixXd full = found.square.selfadjointView<Eigen::Lower>();
    EXPECT_LT((full - square / count).cwiseAbs().maxCoeff(), kTanh * square.cwiseAbs().maxCoeff() / count);
    EXPECT_LT((found.gradient - gradient / count).cwiseAbs().maxCoeff(), kTanh * gradient.cwiseAbs().maxCoeff());
    EXPECT_NEAR(found.error, error / count, kTanh * error / count);
    EXPECT_NEAR(mean_squares(shape, w, runs).sum(), error / count, kTanh * error / count);
  }
}

TEST(Network, StepByHand) {
  const Settings settings(
      "test", Numbers{{"hidden", 1}, {"a_gain", 0.5}}, {},
      Words{{"inputs", "u, w"}, {"outputs", "a"}, {"feedback", "own"}, {"a_sum", "u, a"}, {"a_beside", "w"}});
  const NetworkShape shape = network_shape(plant(), settings);
  ASSERT_EQ(shape.weights(), 6U);
  EXPECT_EQ(shape.weight_names(),
            (std::vector<std::string>{"a.sum.u-0", "a.sum.a-1", "a.0.sum", "a.0.w-0", "a.0.bias", "a.from.0"}));
  const double w[] = {0.1, -0.2, 0.3, 0.4, 0.5, 0.6}, inputs[] = {1, 2}, start[] = {3};
  Network network(shape);
  network.start(inputs, start);
  network.step(w, inputs);
  const double y = 3 + 0.5 * 0.6 * std::tanh(0.3 * (0.1 * 1 - 0.2 * 3) + 0.4 * 2 + 0.5);
  EXPECT_NEAR(network.outputs()[0], y, kTanh);
  const double measured[] = {100};
  network.take(measured);  // the own estimate is fed back, not this
  network.step(w, inputs);
  EXPECT_NEAR(network.outputs()[0], y + 0.5 * 0.6 * std::tanh(0.3 * (0.1 - 0.2 * y) + 0.8 + 0.5), kTanh);
}

TEST(Network, BlackBoxTaps) {
  // lags 2: u and w at k, k-1; a and b at k-1, k-2; as architecture 4 of Kilic et al., Table 3.
  const NetworkShape shape = network_shape(plant(), black_box("none", 2, 10));
  EXPECT_EQ(shape.weights(), 10U * (2 * 2 + 2 * 2) + 10 + 2 * (10 + 1));
  EXPECT_EQ(shape.lags(), 2U);
  EXPECT_EQ(shape.weight_names()[1], "a.0.u-1");
  EXPECT_EQ(shape.weight_names()[5], "a.0.a-2");
}

TEST(Network, AStepAllocatesNothing) {
  const NetworkShape shape = network_shape(plant(), structured("all"));
  const std::vector<NetworkRun> runs = runs_of(shape, 3, 1);
  const Eigen::VectorXd w = initial_weights(shape, 1);
  for (const bool sensitive : {false, true}) {
    Network network(shape, sensitive);
    network.start(runs[0].inputs.col(0).data(), runs[0].outputs.col(0).data());
    const std::uint64_t before = allocations();
    for (int k = 0; k < 100; ++k) {
      network.step(w.data(), runs[0].inputs.col(1).data());
      network.take(runs[0].outputs.col(1).data());
    }
    EXPECT_EQ(allocations(), before) << sensitive;
  }
}

TEST(Network, SettingsAreChecked) {
  const auto refused = [](Settings settings, const char* key, const char* value) {
    settings.set(key, std::string(value));
    try {
      network_shape(plant(), settings);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("taken");
  };
  EXPECT_EQ(refused(black_box("own"), "inputs", "u, x.rate"), "test: 'inputs' names 'x', which is no channel of plant");
  EXPECT_EQ(refused(black_box("own"), "feedback", "some"), "test: 'feedback' is 'some'; it is none, own or all");
  EXPECT_EQ(refused(structured("own"), "b_sum", "u, c"),
            "test: 'b_sum' names 'c', which is neither in 'inputs' nor in 'outputs'");
  EXPECT_NE(refused(black_box("own"), "inputs", "u, w.rate").find("cut_off"), std::string::npos);
}

TEST(Training, FindsAPlantFromItsRuns) {
  // tanh of a first-order lag is within a small network: the error falls by far more than a linear model's would.
  const NetworkShape shape = network_shape(plant(), black_box("all", 1, 6));
  const std::vector<NetworkRun> runs = runs_of(shape, 1500, 1), other = runs_of(shape, 1500, 2);
  const Trainer trainer(shape, runs, other);
  TrainingState state = trainer.begin(initial_weights(shape, 1));
  const double at_first = state.error;
  double before = state.error;
  while (state.epoch < 60 && trainer.epoch(state)) {
    EXPECT_LT(state.error, before);
    before = state.error;
  }
  EXPECT_LT(state.error, 2e-4 * at_first);
  EXPECT_LT(state.best_error, 1e-3 * at_first);
  EXPECT_DOUBLE_EQ(state.best_error, mean_squares(shape, state.best, other).sum());
}

TEST(Training, SameSeedSameWeights) {
  const NetworkShape shape = network_shape(plant(), structured("own"));
  const Trainer trainer(shape, runs_of(shape, 300, 1), {});
  Eigen::VectorXd found[2];
  for (Eigen::VectorXd& weights : found) {
    TrainingState state = trainer.begin(initial_weights(shape, 9));
    for (int i = 0; i < 5; ++i) EXPECT_TRUE(trainer.epoch(state));
    weights = state.weights;
  }
  EXPECT_EQ(found[0], found[1]);
  EXPECT_NE(initial_weights(shape, 9), initial_weights(shape, 8));
}

TEST(Training, RefusesANetworkThatRunsAway) {
  const NetworkShape shape = network_shape(plant(), structured("own"));
  const Trainer trainer(shape, runs_of(shape, 300, 1), {});
  Eigen::VectorXd weights = initial_weights(shape, 1);
  weights.tail(3).setConstant(1e9);
  EXPECT_THROW(trainer.begin(weights), InputError);
}

}  // namespace
}  // namespace faultline
