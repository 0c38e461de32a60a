// The fit of a gap: candidates and their coordinates, the linearisation against direct computation, and what a fit
// recovers.
#include "faultline/gap/fit_gap.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>

#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

ModelChange nominal() {
  ModelChange model;
  model.parameters = servo().nominal();
  return model;
}

ResidualModel model_of(const SimulationSetup& setup, double duration, double segment,
                       const GapOptions& options = GapOptions()) {
  std::vector<SegmentedRun> runs;
  runs.push_back(cut_run(servo(), "run", simulate(servo(), setup, duration), segment));
  return ResidualModel(servo(), std::move(runs), options);
}

std::size_t parameter(const std::string& name) { return static_cast<std::size_t>(servo().parameter(name)); }

std::vector<Eigen::MatrixXf> residuals_of(const ResidualModel& residuals, const ModelChange& model) {
  return {residuals.residuals(model, 0)};
}

double total(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v;
  return sum;
}

TEST(Candidates, AreEveryEffectAtEveryFittingPort) {
  std::size_t expected = 0;
  for (const Port& port : servo().ports) expected += port.effects.size();
  const std::vector<Candidate> all = candidates(servo(), {});
  EXPECT_EQ(all.size(), expected);
  const auto without_effect = candidates(servo(), {"scale"});
  const auto without_place = candidates(servo(), {"scale@sensor.velocity"});
  EXPECT_LT(without_effect.size(), all.size() - 1);
  EXPECT_EQ(without_place.size(), all.size() - 1);
  for (const Candidate& candidate : without_effect) EXPECT_NE(candidate.effect.effect, "scale");
}

TEST(Candidates, CoordinatesGoThereAndBack) {
  for (const Candidate& candidate : candidates(servo(), {}))
    for (std::size_t i = 0; i < candidate.bounds.size(); ++i) {
      const Bounds& b = candidate.bounds[i];
      if (b.minimum >= b.maximum) continue;
      const std::string what = candidate.effect.effect + "@" + candidate.effect.port;
      double last = -std::numeric_limits<double>::infinity();
      for (const double c : {0.0, 0.1, 0.37, 0.5, 0.93, 1.0}) {
        const double value = candidate.from_coordinate(i, c);
        EXPECT_GT(value, last) << what;
        EXPECT_NEAR(candidate.to_coordinate(i, value), c, 1e-9) << what;
        last = value;
      }
      EXPECT_DOUBLE_EQ(candidate.from_coordinate(i, 0), b.minimum) << what;
      EXPECT_NEAR(candidate.from_coordinate(i, 1), b.maximum, 1e-9 * std::abs(b.maximum)) << what;
      EXPECT_EQ(candidate.from_coordinate(i, 1.5), candidate.from_coordinate(i, 1)) << what;
    }
}

TEST(Candidates, StartingPointsLieWithinTheirBounds) {
  for (const Candidate& candidate : candidates(servo(), {})) {
    const auto points = starting_points(candidate);
    const std::string what = candidate.effect.effect + "@" + candidate.effect.port;
    EXPECT_GE(points.size(), 3u) << what;
    EXPECT_LE(points.size(), 60u) << what;
    for (const auto& point : points) {
      ASSERT_EQ(point.size(), candidate.bounds.size()) << what;
      for (std::size_t i = 0; i < point.size(); ++i) {
        EXPECT_GE(point[i], candidate.bounds[i].minimum) << what;
        EXPECT_LE(point[i], candidate.bounds[i].maximum) << what;
      }
    }
  }
}

TEST(Linearisation, SegmentLossIsTheMarginalLikelihoodOverTheStart) {
  constexpr std::size_t kTiny = 40;
  const ResidualModel residuals = model_of(servo_setup("prbs"), 0.12, 1e-3 * static_cast<double>(kTiny));
  const Linearisation linear(residuals, nominal(), {0}, 1);
  const std::vector<Eigen::MatrixXf> r = residuals_of(residuals, nominal());
  const std::vector<double> losses = linear.segment_losses(r);
  const auto sensitivity = residuals.start_sensitivity(nominal(), 0);
  ASSERT_EQ(losses.size(), 3u);
  const auto n = static_cast<Eigen::Index>(kTiny), outputs = r[0].cols();
  for (std::size_t g = 0; g < losses.size(); ++g) {
    const auto first = static_cast<Eigen::Index>(g) * n;
    const auto stacked = [&](const Eigen::MatrixXf& matrix) {
      Eigen::VectorXd column(n * outputs);
      for (Eigen::Index o = 0; o < outputs; ++o)
        column.segment(o * n, n) = matrix.col(o).segment(first, n).cast<double>();
      return column;
    };
    Eigen::MatrixXd covariance = Eigen::MatrixXd::Identity(n * outputs, n * outputs);
    for (const Eigen::MatrixXf& s : sensitivity) covariance += stacked(s) * stacked(s).transpose();
    const Eigen::VectorXd column = stacked(r[0]);
    EXPECT_NEAR(losses[g], 0.5 * column.dot(covariance.llt().solve(column)), 1e-3 * losses[g]) << g;
    EXPECT_LE(losses[g], 0.5 * column.squaredNorm());
  }
}

// `near`: of the loss's root and of the gradient, that columns which go beside the model may be off.
void check_gradient(bool beside, double near_loss, double near_gradient) {
  SimulationSetup setup = servo_setup("multisine");
  setup.parameters = draw_parameters(servo(), 4);
  GapOptions options;
  options.segments.beside = beside;
  const ResidualModel residuals = model_of(setup, 3, 0.5, options);
  const Linearisation linear(residuals, nominal(), {0}, 2);
  const std::vector<Eigen::MatrixXf> r = residuals_of(residuals, nominal());
  const std::vector<Eigen::MatrixXd> products = linear.products(r);
  const std::vector<double> losses = linear.segment_losses(r);
  ASSERT_EQ(products.size(), losses.size());
  for (std::size_t g = 0; g < losses.size(); ++g) EXPECT_NEAR(products[g](0, 0), 2 * losses[g], 1e-4 * (1 + losses[g]));

  // Of the loss along the columns: exact, the loss being quadratic in the residuals.
  const auto column_of = [&](std::size_t index) {
    const Parameter& p = servo().parameters[index];
    const double step = residuals.options().linearisation.difference_tolerances;
    ModelChange moved = nominal();
    moved.parameters[index] += step * p.tolerance * p.nominal;
    return Eigen::MatrixXf((residuals.residuals(moved, 0) - r[0]) / static_cast<float>(step));
  };
  for (std::size_t j = 0; j < linear.free_parameters().size(); ++j) {
    const auto at = 1 + static_cast<Eigen::Index>(j);
    const Eigen::MatrixXf column = column_of(linear.free_parameters()[j]);
    for (std::size_t g = 0; g < losses.size(); ++g) {
      const double size = std::max(1e-3, std::sqrt(products[g](at, at)));
      const auto h = static_cast<float>(10 / size);
      const double up = linear.products({r[0] + h * column})[g](0, 0),
                   down = linear.products({r[0] - h * column})[g](0, 0);
      const double gradient = products[g](at, 0) / size;
      EXPECT_NEAR(gradient, (up - down) / (4 * static_cast<double>(h) * size),
                  near_loss * std::sqrt(products[g](0, 0)) + near_gradient * std::abs(gradient))
          << servo().parameters[linear.free_parameters()[j]].name;
    }
  }

  // Of the residuals in the parameters: with a smaller step from both sides.
  for (const char* name : {"viscous_damping", "flow_coefficient", "moving_mass", "spool_time_constant"}) {
    const Parameter& p = servo().parameters[parameter(name)];
    ModelChange plus = nominal(), minus = nominal();
    plus.parameters[parameter(name)] *= 1 + 0.03 * p.tolerance;
    minus.parameters[parameter(name)] *= 1 - 0.03 * p.tolerance;
    const Eigen::MatrixXf direct = (residuals.residuals(plus, 0) - residuals.residuals(minus, 0)) / 0.06f;
    const Eigen::MatrixXf column = column_of(parameter(name));
    EXPECT_GT(direct.cwiseProduct(column).sum() / direct.norm() / column.norm(), 0.99f) << name;
    EXPECT_NEAR(column.norm() / direct.norm(), 1, 0.05) << name;
  }
}

TEST(Linearisation, GradientAgreesWithDifferences) { check_gradient(false, 1e-3, 1e-3); }
TEST(Linearisation, GradientBesideTheModelIsNearIt) { check_gradient(true, 0.005, 0.05); }

TEST(Linearisation, ProjectedLossIsNoMoreThanTheLoss) {
  SimulationSetup setup = servo_setup("multisine");
  setup.parameters = draw_parameters(servo(), 9);
  const ResidualModel residuals = model_of(setup, 3, 0.5);
  const Linearisation linear(residuals, nominal(), {0}, 2);
  const std::vector<Eigen::MatrixXf> r = residuals_of(residuals, nominal());
  const Eigen::VectorXd z = deviations(servo(), linear.free_parameters(), nominal().parameters);
  EXPECT_EQ(z.norm(), 0);
  double loss = 0;
  for (const double segment : linear.segment_losses(r)) loss += linear.robust(segment);
  const double projected = adjusted(linear, linear.products(r), z).loss;
  EXPECT_LT(projected, 0.5 * loss);  // the run is off by its parameters alone
  EXPECT_NEAR(total(linear.subset({0}).segment_losses(r)), total(linear.segment_losses(r)), 1e-6 * loss);
}

TEST(Linearisation, ProjectedParametersStayWithinTheirBound) {
  SimulationSetup setup = servo_setup("multisine");
  setup.parameters = servo().nominal();
  setup.parameters[parameter("viscous_damping")] *= 3;  // many tolerances
  const ResidualModel residuals = model_of(setup, 3, 0.5);
  const Linearisation linear(residuals, nominal(), {0}, 2);
  const Eigen::VectorXd z = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(linear.free_parameters().size()));
  const std::vector<Eigen::MatrixXd> products = linear.products(residuals_of(residuals, nominal()));
  const double bound = residuals.options().linearisation.parameter_bound_tolerances;
  const auto [loss, move, fraction] = adjusted(linear, products, z);
  EXPECT_EQ(fraction, 0);
  EXPECT_LE(move.cwiseAbs().maxCoeff(), bound * (1 + 1e-12));
  const auto& free = linear.free_parameters();
  const auto at = std::find(free.begin(), free.end(), parameter("viscous_damping")) - free.begin();
  EXPECT_NEAR(move[at], bound, 1e-9);
  // The loss belongs to the move: nothing along a parameter that is not held is better.
  const auto loss_at = [&](const Eigen::VectorXd& to) {
    double sum = 0.5 * (z + to).squaredNorm();
    Eigen::VectorXd v(1 + to.size());
    v << 1, to;
    for (const Eigen::MatrixXd& segment : products) sum += linear.robust(0.5 * v.dot(segment * v));
    return sum;
  };
  EXPECT_NEAR(loss_at(move), loss, 1e-6 * std::abs(loss));
  for (Eigen::Index i = 0; i < z.size(); ++i) {
    if (std::abs(move[i]) > bound - 1e-6) continue;
    for (const double h : {-0.3, 0.3}) {
      Eigen::VectorXd other = move;
      other[i] += h;
      EXPECT_GT(loss_at(other), loss - 1e-3 * std::abs(loss))
          << servo().parameters[free[static_cast<std::size_t>(i)]].name;
    }
  }
}

TEST(Linearisation, RobustLossIsTheLossNearTheNoiseAndGrowsSlowlyBeyond) {
  const double values = 1000, least = 0.2;
  EXPECT_EQ(robust(0.5 * values, values, least), 0);
  EXPECT_NEAR(robust(0.51 * values, values, least), 0.01 * values, 0.02 * 0.01 * values);
  EXPECT_NEAR(robust(50 * values, values, least), 0.5 * values * std::log(100), 1e-9 * values);
  EXPECT_EQ(robust(0.01 * values, values, least), 0.5 * values * std::log(least));  // no better than the least variance
  const double h = 1e-4 * values;                                                   // the weight is its slope
  for (const double loss : {300.0, 500.0, 5000.0})
    EXPECT_NEAR(robust_weight(loss, values, least),
                (robust(loss + h, values, least) - robust(loss - h, values, least)) / (2 * h), 1e-5);
}

TEST(FitGap, RecoversParametersThatAreOffByTwoTolerances) {
  SimulationSetup setup = servo_setup("prbs");
  setup.parameters = servo().nominal();
  setup.parameters[parameter("viscous_damping")] *= 1.2;
  setup.parameters[parameter("compliance")] *= 0.7;
  ResidualModel residuals = model_of(setup, 6, 0.5);
  FitResult fit;
  fit.model = nominal();
  for (int round = 0; round < 9; ++round) {  // the damping lies in a flat valley of 6 s of random voltage
    residuals.settle_starts(fit.model, 0);
    const Linearisation linear(residuals, fit.model, {0}, 2);
    const double before = total(linear.segment_losses(residuals_of(residuals, fit.model)));
    fit = fit_gap(residuals, fit.model, {}, linear, 4);
    EXPECT_LE(total(linear.segment_losses(residuals_of(residuals, fit.model))), 1.001 * before);
  }
  const Eigen::VectorXd z = deviations(
      servo(), {parameter("viscous_damping"), parameter("compliance"), parameter("moving_mass")}, fit.model.parameters);
  EXPECT_NEAR(z[0], 2, 0.4);
  EXPECT_NEAR(z[1], -2, 0.1);
  EXPECT_NEAR(z[2], 0, 0.5);
}

TEST(FitGap, FindsTheSizeOfAnEffect) {
  SimulationSetup setup = servo_setup("multisine");
  setup.effects.push_back(parse_effect("scale@sensor.velocity:factor=1.12"));
  const ResidualModel residuals = model_of(setup, 4, 0.5);
  std::vector<Candidate> effect;
  for (const Candidate& candidate : candidates(servo(), {}))
    if (candidate.effect.effect == "scale" && candidate.effect.port == "sensor.velocity") effect.push_back(candidate);
  ASSERT_EQ(effect.size(), 1u);
  effect.front().effect.parameters = {1.02};
  const Linearisation linear(residuals, nominal(), {0}, 2);
  const FitResult fit = fit_gap(residuals, nominal(), effect, linear, 8);
  EXPECT_NEAR(fit.effects.front().effect.parameters.front(), 1.12, 0.01);
  ASSERT_EQ(fit.model.effects.size(), 1u);
  const Linearisation around(residuals, fit.model, {0}, 2);
  const Eigen::MatrixXd covariance = uncertainty(residuals, fit, around);
  ASSERT_EQ(covariance.rows(), static_cast<Eigen::Index>(around.free_parameters().size()) + 1);
  const double deviation = std::sqrt(covariance(covariance.rows() - 1, covariance.cols() - 1));
  EXPECT_GT(deviation, 1e-5);  // of a coordinate over 0.7 .. 1.3
  EXPECT_LT(deviation, 0.02);
}

}  // namespace
}  // namespace faultline
