// Differential relations: parameters of known equations, intervals that hold, holes, bad settings; the covariance under
// coloured noise against the double sum it stands for.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <map>

#include "allocations.h"
#include "faultline/estimators/coloured_noise.h"
#include "faultline/estimators/estimator_stage.h"
#include "faultline/numerics/random.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kPeriod = 0.01, kSpeedNoise = 0.05, kTorqueNoise = 0.05;

Datasheet shaft() {
  Datasheet sheet;
  sheet.rig = "shaft";
  sheet.sample_period = kPeriod;
  const auto channel = [&](const char* name, const char* unit, double noise) {
    Channel c;
    c.name = name;
    c.unit = unit;
    c.role = Role::output;
    c.minimum = -1e6;
    c.maximum = 1e6;
    c.noise_std = noise;
    sheet.channels.push_back(c);
  };
  channel("speed", "rad/s", kSpeedNoise);
  channel("torque", "N m", kTorqueNoise);
  channel("unused", "Pa", 1);
  return sheet;
}

using Words = std::map<std::string, std::string>;
using Numbers = std::map<std::string, double>;

// speed' = a speed + b torque with a = -4, b = 30.
StageSpec first_order(const Words& words = {}, const Numbers& numbers = {},
                      const std::vector<double>& first = {-3, 20}) {
  Words all = {
      {"model", "differential_relation"}, {"relation", "speed' = a speed + b torque"}, {"units", "1/s, rad/(s^2 N m)"}};
  Numbers values = {{"filter_order", 2},         {"bandwidth", 30},        {"interpolation", 3}, {"forgetting", 0.97},
                    {"initial_covariance", 100}, {"covariance_limit", 10}, {"excitation", 1}};
  for (const auto& [key, value] : words) all[key] = value;
  for (const auto& [key, value] : numbers) values[key] = value;
  return {"shaft", "recursive_least_squares", Settings("shaft.yaml:1: 'shaft'", values, {{"first", first}}, all)};
}

// torque: sines; speed: the equation, in fine steps.
struct Shaft {
  explicit Shaft(double gain = 30) : b(gain) {}
  static double torque(double t) { return 3 + std::sin(3 * t) + 0.8 * std::sin(7.3 * t) + 0.6 * std::sin(17 * t + 1); }
  void advance(double dt) {
    const int steps = 50;
    for (int k = 0; k < steps; ++k) {
      const double h = dt / steps;
      const auto rate = [&](double at, double s) { return -4 * s + b * torque(at); };
      const double k1 = rate(t, speed), k2 = rate(t + h / 2, speed + h / 2 * k1),
                   k3 = rate(t + h / 2, speed + h / 2 * k2), k4 = rate(t + h, speed + h * k3);
      speed += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
      t += h;
    }
  }
  Sample sample(Random* noise = nullptr) const {
    Sample s;
    s.time = t;
    s.values = {speed, torque(t), 0};
    if (noise) {
      s.values[0] += kSpeedNoise * noise->normal();
      s.values[1] += kTorqueNoise * noise->normal();
    }
    return s;
  }
  double b, t = 0, speed = 22;
};

TEST(DifferentialRelation, FindsTheParametersOfItsEquation) {
  for (const double bandwidth : {15.0, 40.0}) {
    EstimatorStage stage(shaft(), first_order({}, {{"bandwidth", bandwidth}}));
    Estimate estimate;
    Shaft run;
    for (int k = 0; k < 400; ++k) {
      stage.process(run.sample(), estimate);
      run.advance(kPeriod);
    }
    ASSERT_EQ(estimate.quantities.size(), 2u);
    EXPECT_EQ(estimate.quantities[0].name, "a");
    EXPECT_EQ(estimate.quantities[1].unit, "rad/(s^2 N m)");
    EXPECT_NEAR(estimate.quantities[0].value, -4, 4e-3);
    EXPECT_NEAR(estimate.quantities[1].value, 30, 3e-2);
    EXPECT_EQ(estimate.observed, 1);
    EXPECT_LT(std::abs(estimate.innovation[0]), 0.05);
    EXPECT_EQ(stage.innovation_names(), std::vector<std::string>{"speed"});
    ASSERT_EQ(estimate.state.size(), 2u);
    EXPECT_EQ(estimate.state[1], estimate.quantities[1].value);
    EXPECT_DOUBLE_EQ(std::sqrt(estimate.covariance[3]), estimate.quantities[1].std);
    EXPECT_NEAR(estimate.covariance[1], estimate.covariance[2], 1e-9);
    EXPECT_LT(estimate.covariance[1], 0);  // speed and torque are positive in the mean
  }
}

TEST(DifferentialRelation, LeavesOutWhatIsBelowTheLeastOfItsLeftSide) {
  EstimatorStage stage(shaft(), first_order({}, {{"least", 20}}));
  Estimate estimate;
  Shaft run;
  int used = 0, left_out = 0;
  for (int k = 0; k < 400; ++k) {
    Sample sample = run.sample();
    stage.process(sample, estimate);
    run.advance(kPeriod);
    if (k < 60) continue;  // the filters' settling
    (estimate.observed > 0 ? used : left_out) += 1;
    // By the filtered speed, which comes some 70 ms late.
    if (sample.values[0] > 27) {
      EXPECT_EQ(estimate.observed, 1) << k;
    } else if (sample.values[0] < 15) {
      EXPECT_EQ(estimate.observed, 0) << k;
    }
  }
  EXPECT_GT(used, 50);
  EXPECT_GT(left_out, 50);
  EXPECT_NEAR(estimate.quantities[0].value, -4, 4e-2);
}

TEST(DifferentialRelation, HigherDerivativesOnBothSides) {
  // speed'' = c speed' + d torque' from the derivative of the same equation: c = -4, d = 30.
  EstimatorStage stage(shaft(), first_order({{"relation", "speed'' = c speed' + d torque'"}},
                                            {{"filter_order", 3}, {"bandwidth", 40}, {"excitation", 10}}));
  Estimate estimate;
  Shaft run;
  for (int k = 0; k < 600; ++k) {
    stage.process(run.sample(), estimate);
    run.advance(kPeriod);
  }
  EXPECT_NEAR(estimate.quantities[0].value, -4, 0.02);
  EXPECT_NEAR(estimate.quantities[1].value, 30, 0.1);
}

TEST(DifferentialRelation, TellsParametersInTheUnitsItIsGiven) {
  EstimatorStage si(shaft(), first_order());
  EstimatorStage stand(shaft(), first_order({{"units", "1/s, rpm/(s N m)"}}, {}, {-3, 20 * 30 / 3.14159265358979}));
  Estimate one, other;
  Shaft run;
  Random noise(2);
  for (int k = 0; k < 300; ++k) {
    const Sample sample = run.sample(&noise);
    si.process(sample, one);
    stand.process(sample, other);
    run.advance(kPeriod);
  }
  EXPECT_NEAR(one.quantities[0].value, other.quantities[0].value, 1e-9);
  EXPECT_NEAR(one.quantities[1].value * 30 / 3.14159265358979, other.quantities[1].value, 1e-7);
  EXPECT_NEAR(one.quantities[1].std * 30 / 3.14159265358979, other.quantities[1].std, 1e-7);
}

TEST(DifferentialRelation, IntervalsHoldUnderColouredNoise) {
  // Ends of independent runs. Noise as if it were white would claim intervals of about half the width.
  for (const double order : {1.0, 3.0}) {
    int runs = 0, within[2] = {};
    for (std::uint64_t seed = 1; seed <= 300; ++seed) {
      EstimatorStage stage(shaft(), first_order({}, {{"interpolation", order}}, {-4.4, 28}));
      Estimate estimate;
      Shaft run;
      run.t = 0.37 * static_cast<double>(seed);
      Random noise(seed);
      for (int k = 0; k < 250; ++k) {
        stage.process(run.sample(&noise), estimate);
        run.advance(kPeriod);
      }
      ++runs;
      const double truth[2] = {-4, 30};
      for (std::size_t i = 0; i < 2; ++i)
        within[i] += std::abs(estimate.quantities[i].value - truth[i]) < 1.645 * estimate.quantities[i].std;
    }
    for (const int count : within) {
      EXPECT_GT(count, 0.85 * runs) << order;
      EXPECT_LT(count, 0.97 * runs) << order;
    }
  }
}

TEST(DifferentialRelation, HolesAndBadSamplesNeverReachTheFilters) {
  EstimatorStage stage(shaft(), first_order());
  Estimate estimate;
  Shaft run;
  int unused = 0;
  for (int k = 0; k < 800; ++k) {
    Sample sample = run.sample();
    if (k % 20 == 7) sample.values[0] = std::nan("");
    if (k % 20 == 13) sample.values[1] = 1e9;
    if (k % 20 == 14) sample.values[1] = 1e6;           // the end of its range
    if (k % 20 == 16) sample.values[2] = std::nan("");  // no business of this relation
    const bool lost = k % 50 == 31 || (k > 400 && k < 440);
    if (!lost) {
      ASSERT_TRUE(stage.process(sample, estimate));
      EXPECT_EQ(estimate.restarted, k == 0);
      if (k > 100) unused += estimate.observed == 0;
      if (k > 150) {
        ASSERT_NEAR(estimate.quantities[0].value, -4, 0.02) << k;
        ASSERT_NEAR(estimate.quantities[1].value, 30, 0.1) << k;
      }
    }
    run.advance(kPeriod);
  }
  // Three samples in twenty, and 8/30 s after the hole of 0.4 s.
  EXPECT_NEAR(unused, 99 + 23, 8);
}

TEST(DifferentialRelation, UnevenStampsAreFollowed) {
  EstimatorStage stage(shaft(), first_order());
  Estimate estimate;
  Shaft run;
  Random jitter(5);
  for (int k = 0; k < 500; ++k) {
    stage.process(run.sample(), estimate);
    run.advance(kPeriod * jitter.uniform(0.6, 1.4));
  }
  EXPECT_NEAR(estimate.quantities[0].value, -4, 0.01);
  EXPECT_NEAR(estimate.quantities[1].value, 30, 0.06);
}

TEST(DifferentialRelation, ARowOfAnotherRigBeginsTheLeastSquaresAnew) {
  double error[2] = {};  // of the gain, mean over what follows a change of it; with renewal, without
  for (const bool renewed : {true, false}) {
    EstimatorStage stage(shaft(), first_order({}, {{"forgetting", 0.995}, {"renewal", renewed ? 6 : 1e9}}, {-4.4, 28}));
    Estimate estimate;
    Shaft run;
    Random noise(3);
    int paused = 0;
    for (int k = 0; k < 1000; ++k) {
      if (k == 600) run.b = 36;
      stage.process(run.sample(&noise), estimate);
      run.advance(kPeriod);
      if (k > 100) paused += estimate.observed == 0;
      if (k >= 640 && k < 840) error[renewed ? 0 : 1] += std::abs(estimate.quantities[1].value - 36) / 200;
      if (renewed && k >= 630) {
        EXPECT_LT(std::abs(estimate.quantities[1].value - 36), 4 * estimate.quantities[1].std) << k;
      }
    }
    EXPECT_NEAR(paused, renewed ? 27 : 0, renewed ? 2 : 0);  // 8/30 s, once
  }
  EXPECT_LT(error[0], 0.5);
  EXPECT_GT(error[1], 1.5);
}

TEST(DifferentialRelation, AStepAllocatesNothing) {
  EstimatorStage stage(shaft(), first_order());
  Estimate estimate;
  Shaft run;
  Random noise(1);
  std::vector<Sample> samples;
  for (int k = 0; k < 300; ++k) {
    samples.push_back(run.sample(&noise));
    if (k % 40 == 9) samples.back().values[0] = std::nan("");
    run.advance(k < 100 ? kPeriod : kPeriod * noise.uniform(0.7, 1.3));  // even, then new matrices at every step
  }
  stage.process(samples[0], estimate);
  const std::uint64_t before = allocations();
  for (std::size_t k = 1; k < samples.size(); ++k) stage.process(samples[k], estimate);
  EXPECT_EQ(allocations() - before, 0u);
}

TEST(DifferentialRelation, BadSettingsAreOneLineThatSaysWhatToDo) {
  struct Bad {
    Words words;
    Numbers numbers;
    std::vector<double> first;
    const char* says;
  };
  const std::vector<double> first = {-3, 20};
  const std::vector<Bad> cases = {
      {{{"relation", "speed' : a speed"}}, {}, {1}, "there is no '='"},
      {{{"relation", "sped' = a speed + b torque"}}, {}, first, "no channel 'sped'; it has speed, torque, unused"},
      {{{"relation", "speed'' = a speed + b torque"}}, {}, first, "no derivative 2 of 'speed'"},
      {{{"relation", "speed' = a speed + a torque"}}, {}, first, "two parameters are called 'a'"},
      {{{"relation", "speed' = a speed - b torque"}}, {}, first, "'-' stands where '+' should"},
      {{{"relation", "speed' = a speed + b"}}, {}, first, "'b' stands alone"},
      {{{"relation", "speed' ="}}, {}, first, "it has 0 parameters"},
      {{{"units", "1/s"}}, {}, first, "must name 2 units, one for each of a, b; it names 1"},
      {{{"units", "1/s, rad/(s N m)"}}, {}, first, "gives b in rad/(s N m), which is not (rad/s)/s^1 per (N m)/s^0"},
      {{{"units", "1/s, furlong"}}, {}, first, "'units' of b"},
      {{}, {}, {-3, 0}, "'first' of b is 0"},
      {{}, {}, {-3}, "must have 2 numbers"},
      {{}, {{"filter_order", 5}}, first, "'filter_order' is 5"},
      {{}, {{"filter_order", 1.5}}, first, "must be a whole number"},
      {{}, {{"interpolation", 4}}, first, "'interpolation' is 4"},
      {{}, {{"bandwidth", 1e4}}, first, "'bandwidth' is 10000"},
      {{}, {{"excitation", 0}}, first, "'excitation' is 0"},
      {{}, {{"forgetting", 1.2}}, first, "'forgetting' is 1.2"},
      {{}, {{"renewal", 1}}, first, "'renewal' is 1"},
      {{}, {{"bandwith", 30}}, first, "key 'bandwith' is not known"},
  };
  for (const Bad& bad : cases) {
    try {
      EstimatorStage(shaft(), first_order(bad.words, bad.numbers, bad.first));
      ADD_FAILURE() << "taken: " << bad.says;
    } catch (const InputError& error) {
      const std::string text = error.what();
      EXPECT_NE(text.find(bad.says), std::string::npos) << text;
      EXPECT_EQ(text.rfind("shaft.yaml:1: 'shaft'", 0), 0u) << text;
      EXPECT_EQ(text.find('\n'), std::string::npos) << text;
    }
  }
}

TEST(ColouredNoise, IsTheDoubleSumItStandsFor) {
  const int n = 2, rows = 60;
  const double g = 0.9;
  const std::vector<double> c = {4, 2, -1, 0.5};
  RecursiveLeastSquares fit(n, {g, 10, 1e9, 0});
  ColouredNoise noise(n, c, 10);
  const double start[n] = {0, 0};
  fit.reset(start);
  Random random(8);
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(rows, n);
  for (int k = 0; k < rows; ++k) {
    if (k % 11 == 4) {  // a sample without a row: time goes on, nothing is forgotten
      noise.skip();
      continue;
    }
    h.row(k) << 1 + random.normal(), random.normal();
    const Eigen::Vector2d row = h.row(k);
    ASSERT_TRUE(fit.step(row.data(), 1e-3 * random.normal()));
    noise.take(row.data(), fit.forgetting());
  }
  // Weights: forgetting of all rows taken since.
  Eigen::VectorXd weight = Eigen::VectorXd::Zero(rows);
  double w = 1;
  for (int k = rows - 1; k >= 0; --k) {
    if (k % 11 == 4) continue;
    weight[k] = w;
    w *= g;
  }
  Eigen::Matrix2d b = w * w * c[0] / 10 * Eigen::Matrix2d::Identity();
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < rows; ++j)
      if (std::abs(i - j) < static_cast<int>(c.size()))
        b += weight[i] * weight[j] * c[static_cast<std::size_t>(std::abs(i - j))] * h.row(i).transpose() * h.row(j);
  Eigen::Matrix2d p, stated;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) p(i, j) = fit.covariance(i, j);
  noise.covariance(fit, stated.data());
  EXPECT_LT((stated - p * b * p).norm(), 1e-12 * stated.norm());
}

}  // namespace
}  // namespace faultline
