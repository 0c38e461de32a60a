// The signature table and its isolator on changes of parameters made by hand: each signature, sizes and their bounds,
// what cannot be told apart, pairs, steps one after the other, bad estimates.
#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "config_folder.h"
#include "faultline/isolation/isolator.h"
#include "faultline/isolation/parameter_change.h"
#include "faultline/isolation/signature_table.h"
#include "faultline/numerics/random.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

const Datasheet& drive() {
  static const Datasheet sheet = find_datasheet(config_folder(), "hydraulic_drive");
  return sheet;
}

const std::string kMotor = "scale@transmission.motor", kPump = "scale@transmission.pump",
                  kBoth = "scale@transmission.displacement", kInertia = "added_mass@force.shaft",
                  kFriction = "viscous_friction@force.shaft";

Settings settings() {
  return Settings("table.yaml:1", {{"fit", 14}, {"relative_error", 0.02}},
                  {{"exponents_motor", {0, 1, 0}},
                   {"exponents_pump", {0, 0, 1}},
                   {"exponents_both", {0, 1, 1}},
                   {"exponents_inertia", {-1, -1, -1}},
                   {"exponents_friction", {1, 0, 0}}},
                  {{"signatures", "motor, pump, both, inertia, friction"},
                   {"fault_motor", kMotor},
                   {"fault_pump", kPump},
                   {"fault_both", kBoth},
                   {"fault_inertia", kInertia},
                   {"fault_friction", kFriction},
                   {"unit_inertia", "inertia"},
                   {"unit_friction", "viscous_friction"}});
}

SignatureTable table() { return {drive(), settings(), 3}; }

// Of `std` each, correlated as such estimates are: the second and the third by -0.99.
Matrix covariance(double std) {
  Matrix v = Matrix::Identity(3, 3);
  v(1, 2) = v(2, 1) = -0.99;
  return std * std * v;
}

Vector change(double a, double b, double c) { return Eigen::Vector3d(std::log(a), std::log(b), std::log(c)); }

TEST(SignatureTable, EachFaultByItsSignatureWithItsSize) {
  const double mass = 1.5606e-3, friction = 1.3733e-2;
  const std::vector<std::tuple<std::string, Vector, double>> cases = {
      {kMotor, change(1, 1.1, 1), 1.1},
      {kMotor, change(1, 0.95, 1), 0.95},
      {kPump, change(1, 1, 1 / 1.1), 1 / 1.1},
      {kBoth, change(1, 1.1, 1.1), 1.1},
      {kInertia, change(1 / 1.1, 1 / 1.1, 1 / 1.1), 0.1 * mass},
      {kFriction, change(1.1, 1, 1), 0.1 * friction}};
  for (const auto& [name, y, size] : cases) {
    const auto answer = table().explain(y, covariance(0.005));
    ASSERT_TRUE(answer.explained);
    const RankedHypothesis& best = answer.first.front();
    EXPECT_EQ(best.name(), name);
    EXPECT_NEAR(best.size(), size, 1e-9 * std::abs(size)) << name;
    EXPECT_GT(best.evidence, answer.first[1].evidence + 6) << name;
    EXPECT_TRUE(answer.second.empty());
    const SizeInterval bounds = best.sizes(best.std);
    EXPECT_LT(bounds.low, size);
    EXPECT_GT(bounds.high, size);
  }
}

TEST(SignatureTable, SizesHoldTheTruthAsOftenAsTheySay) {
  Random random(1);
  const Matrix v = covariance(0.01);
  const Matrix root = v.llt().matrixL();
  Settings exact = settings();
  exact.set("relative_error", 0.0);
  const SignatureTable plain(drive(), exact, 3);
  int inside = 0;
  for (int k = 0; k < 2000; ++k) {
    const Vector noise = root * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
    for (const RankedHypothesis& h : plain.explain(change(1, 1.1, 1) + noise, v).first)
      if (h.name() == kMotor) inside += h.sizes(h.std).low <= 1.1 && 1.1 <= h.sizes(h.std).high;
  }
  EXPECT_NEAR(inside / 2000.0, 0.9, 0.03);
}

TEST(SignatureTable, SizesInAUnitOfTheRigKnowItsTolerance) {
  // 10 % more of an inertia or a friction that is itself off the datasheet by its tolerance of 3 and of 10 %.
  Settings exact = settings();
  exact.set("relative_error", 0.0);
  const SignatureTable plain(drive(), exact, 3);
  const auto inertia = plain.explain(change(1 / 1.1, 1 / 1.1, 1 / 1.1), covariance(1e-5)).first.front();
  EXPECT_NEAR(inertia.std / inertia.amplitude, 0.03, 1e-3);
  const auto friction = plain.explain(change(1.1, 1, 1), covariance(1e-5)).first.front();
  EXPECT_NEAR(friction.std / friction.amplitude, 0.1, 1e-3);
  const auto motor = plain.explain(change(1, 1.1, 1), covariance(1e-5)).first.front();
  EXPECT_LT(motor.std / motor.amplitude, 1e-3);
}

TEST(SignatureTable, ASizeMayGrowAsItsParameterFalls) {
  Settings s = settings();
  s.set("signatures", std::string("metering"));
  s.set("fault_metering", std::string("clogging@restriction.valve"));
  s.set("opposite_metering", std::string("yes"));
  s.set("exponents_metering", std::vector<double>{1, 0, 0});
  const auto answer = SignatureTable(drive(), s, 3).explain(change(0.9, 1, 1), covariance(0.002));
  ASSERT_TRUE(answer.explained);
  EXPECT_NEAR(answer.first.front().size(), 0.1, 1e-9);
  const auto wider = SignatureTable(drive(), s, 3).explain(change(1.1, 1, 1), covariance(0.002));
  ASSERT_TRUE(wider.explained);
  EXPECT_NEAR(wider.first.front().size(), -0.1, 1e-9);
  // More than the datasheet's 40 %.
  EXPECT_FALSE(SignatureTable(drive(), s, 3).explain(change(0.4, 1, 1), covariance(0.002)).explained);
}

TEST(SignatureTable, BoundsOfTheDatasheetHold) {
  // Friction only grows: less of it is none of these faults.
  const auto answer = table().explain(change(0.9, 1, 1), covariance(0.002));
  EXPECT_FALSE(answer.explained && answer.first.front().name() == kFriction);
  // A displacement of 0.6 is below what the datasheet allows for, and so is what would make it up with another.
  EXPECT_FALSE(table().explain(change(1, 0.6, 0.6), covariance(0.002)).explained);
}

TEST(SignatureTable, WithPoorEstimatesRivalsStandSideBySide) {
  // Motor efficiency up by 3 %, both parameters known to 5 % along their common direction only.
  const auto answer = table().explain(change(1, 1.03, 1), covariance(0.2));
  ASSERT_TRUE(answer.explained);
  EXPECT_LT(answer.first[0].evidence - answer.first[1].evidence, 3);
}

TEST(SignatureTable, PairsAndWhatTheirPlaneLeavesOpen) {
  // In the plane of a12 and a13 lie three signatures: any two of them explain it.
  auto answer = table().explain(change(1, 1.1, 1 / 1.08), covariance(0.003));
  ASSERT_TRUE(answer.explained);
  std::vector<std::string> first, second;
  for (const auto& h : answer.first) first.push_back(h.name());
  for (const auto& h : answer.second) second.push_back(h.name());
  ASSERT_FALSE(second.empty());
  for (const std::string& name : {kMotor, kPump})
    EXPECT_TRUE(std::count(first.begin(), first.end(), name) + std::count(second.begin(), second.end(), name)) << name;
  EXPECT_TRUE(std::count(first.begin(), first.end(), kBoth) + std::count(second.begin(), second.end(), kBoth));

  // Motor efficiency and friction span a plane of their own.
  answer = table().explain(change(1.12, 1.08, 1), covariance(0.003));
  ASSERT_TRUE(answer.explained);
  EXPECT_EQ(answer.first[0].name(), kFriction);
  EXPECT_EQ(answer.second[0].name(), kMotor);
  EXPECT_NEAR(answer.second[0].size(), 1.08, 1e-6);
  for (std::size_t i = 1; i < answer.first.size(); ++i)
    EXPECT_LT(answer.first[i].evidence, answer.first[0].evidence - 20);
}

TEST(SignatureTable, ThreeAtOnceAreNotExplained) {
  EXPECT_FALSE(table().explain(change(0.7, 1.3, 0.75), covariance(0.001)).explained);
}

TEST(SignatureTable, SettingsThatMakeNoSenseAreRefused) {
  Settings wrong = settings();
  wrong.set("fault_motor", std::string("scale@transmission.wheel"));
  EXPECT_THROW(SignatureTable(drive(), wrong, 3), InputError);
  wrong = settings();
  wrong.set("exponents_motor", std::vector<double>{0, 0, 0});
  EXPECT_THROW(SignatureTable(drive(), wrong, 3), InputError);
  EXPECT_THROW(SignatureTable(drive(), settings(), 2), InputError);
}

// ---- the isolator, on estimates of its own

ParameterChangeOptions two_parameters() {
  ParameterChangeOptions options;
  options.period_s = 0.1;
  options.memory_s = options.block_s = 0.2;
  options.window_s = 4;
  options.relative_error = 0.03;
  options.inflation = {1, 1};
  options.shown = {1e3, 1e3};
  options.floor = {0.001, 0.001};
  return options;
}

TEST(ParameterChange, WhatTheHealthyMotionDidNotShowIsLeftOut) {
  const ParameterChangeOptions options = two_parameters();
  const auto chi2 = [&](double reference_std, double second) {
    ParameterChange change(2, options);
    const double theta[] = {1.0, second}, covariance[] = {1e-4, 0, 0, 1e-4};
    for (int k = 0; k < 40; ++k) change.add(theta, covariance, true);
    ParameterLevel reference;
    reference.theta = Eigen::Vector2d(1, 1);
    reference.covariance = Eigen::Vector2d(1e-6, reference_std * reference_std).asDiagonal();
    return change.step_from(reference).chi2;
  };
  EXPECT_GT(chi2(0.02, 1.5), 100);  // known to 2 %, moved by 50 %
  EXPECT_LT(chi2(0.15, 1.5), 1);    // known to 15 %
  EXPECT_LT(chi2(0.02, 1.001), 1);
}

TEST(ParameterChange, AReferenceThatWasHardlyShownIsBiased) {
  ParameterChangeOptions options = two_parameters();
  const double theta[] = {1.0, 1.1}, covariance[] = {1e-6, 0, 0, 1e-6};  // now shown well
  const auto chi2 = [&](double shown) {
    options.shown = {1e3, shown};
    ParameterChange change(2, options);
    for (int k = 0; k < 40; ++k) change.add(theta, covariance, true);
    ParameterLevel reference;
    reference.theta = Eigen::Vector2d(1, 1);
    reference.covariance = Eigen::Vector2d(1e-6, 1e-4).asDiagonal();
    return change.step_from(reference).chi2;
  };
  const double trusted = chi2(1e3);
  EXPECT_NEAR(chi2(0.01), trusted / 2, 0.05 * trusted);  // as large as its scatter
  EXPECT_LT(chi2(0.002), trusted / 20);
}

TEST(ParameterChange, ASilentBeginningIsNoTimeOfLearning) {
  ParameterChange change(2, two_parameters());
  const double theta[] = {1.0, 1.0}, covariance[] = {1e-4, 0, 0, 1e-4};
  for (int k = 0; k < 20; ++k) change.add(theta, covariance, false);
  EXPECT_EQ(change.seconds(), 0);
  for (int k = 0; k < 20; ++k) change.add(theta, covariance, true);
  EXPECT_NEAR(change.seconds(), 2, 1e-9);
  for (int k = 0; k < 10; ++k) change.add(theta, covariance, false);  // later it is
  EXPECT_NEAR(change.seconds(), 3, 1e-9);
}

constexpr double kTrue[] = {-8.8, 8.68e-4, -1.199e-3};

class TableIsolation : public ::testing::Test {
 protected:
  static StageSpec spec(double place) {
    StageSpec s;
    s.name = "table";
    s.type = "signature_table";
    s.settings = settings();
    s.settings.set("parameters", std::string("a11, a12, a13"));
    for (const auto& [key, value] : std::vector<std::pair<std::string, double>>{{"memory", 0.4},
                                                                                {"block", 0.2},
                                                                                {"window", 20},
                                                                                {"least", 0.8},
                                                                                {"scatter", 3},
                                                                                {"learn", 10},
                                                                                {"threshold", 30},
                                                                                {"hold", 8},
                                                                                {"rival", 0},
                                                                                {"rival_least", 6},
                                                                                {"most_rivals", 1},
                                                                                {"model_error", 0},
                                                                                {"confirm", 2},
                                                                                {"place", place}})
      s.settings.set(key, value);
    s.settings.set("inflation", std::vector<double>{1, 1, 1});
    s.settings.set("shown", std::vector<double>{1e3, 1e3, 1e3});
    s.settings.set("floor", std::vector<double>{0.001, 0.001, 0.001});
    return s;
  }

  // `seconds` of estimates at 10 ms whose parameters are those of the rig times `factors`.
  void run(double seconds, double f1, double f2, double f3) {
    const double factors[] = {f1, f2, f3};
    const double relative[] = {0.03, 0.017, 0.017};
    for (int k = 0; k < static_cast<int>(std::lround(seconds * 100)); ++k, time_ += 0.01) {
      // As least squares that forget: noise with their memory.
      for (double& n : noise_) n = 0.95 * n + std::sqrt(1 - 0.95 * 0.95) * random_.normal();
      Estimate e;
      e.time = time_;
      e.observed = bad_ ? 0 : 1;
      e.channel_status.assign(drive().channels.size(), ChannelStatus::good);
      e.covariance.assign(9, 0);
      for (int i = 0; i < 3; ++i) {
        const double std = relative[i] * std::abs(kTrue[i]);
        const double n = i == 2 ? 0.99 * noise_[1] + std::sqrt(1 - 0.99 * 0.99) * noise_[2] : noise_[i];
        e.state.push_back(bad_ ? std::nan("")
                               : kTrue[i] * factors[i] + (i == 2 ? -1 : 1) * std * n * (i == 2 ? -1 : 1));
        e.covariance[static_cast<std::size_t>(4 * i)] = std * std;
      }
      e.covariance[5] = e.covariance[7] = 0.99 * std::sqrt(e.covariance[4] * e.covariance[8]);
      one_->process(e, {}, first_);
      two_->process(e, {}, second_);
    }
  }
  static std::string name(const Finding& f) { return f.active ? f.effect + "@" + f.port : "nothing"; }

  double time_ = 0, noise_[3] = {};
  bool bad_ = false;
  Random random_{4};
  Finding first_, second_;
  std::unique_ptr<Isolator> one_ = make_isolator(drive(), spec(1)), two_ = make_isolator(drive(), spec(2));
};

TEST_F(TableIsolation, HealthyForLongThenNamedInTime) {
  run(300, 1, 1, 1);
  EXPECT_FALSE(first_.active);
  run(2.5, 1, 1.1, 1);
  EXPECT_EQ(name(first_), kMotor);
  EXPECT_NEAR(first_.since, 300, 1);
  run(20, 1, 1.1, 1);
  EXPECT_EQ(name(first_), kMotor);
  EXPECT_NEAR(first_.size, 1.1, 0.01);
  EXPECT_LT(first_.low, 1.1);
  EXPECT_GT(first_.high, 1.1);
  EXPECT_FALSE(second_.active);
}

TEST_F(TableIsolation, AStepWhileItLearnsIsNoReference) {
  // After 5 s; what it then learns is the rig with that step.
  run(5, 1, 1, 1);
  run(9.5, 1, 1.1, 1);
  EXPECT_FALSE(one_->reference());
  run(5, 1, 1.1, 1);
  ASSERT_TRUE(one_->reference());
  EXPECT_NEAR(one_->reference()->numbers[1], 1.1 * kTrue[1], 0.01 * kTrue[1]);
  EXPECT_FALSE(first_.active);
  run(4, 1, 1.1, 1 / 1.1);
  EXPECT_EQ(name(first_), kPump);
}

TEST_F(TableIsolation, OneAfterTheOtherAndBack) {
  run(30, 1, 1, 1);
  run(14, 1, 1.1, 1);
  EXPECT_EQ(name(first_), kMotor);
  run(5, 1, 1.1, 1 / 1.1);
  EXPECT_EQ(name(first_), kMotor);
  EXPECT_EQ(name(second_), kPump);
  EXPECT_NEAR(second_.size, 1 / 1.1, 0.03);
  run(20, 1, 1, 1);
  EXPECT_FALSE(first_.active);
  EXPECT_FALSE(second_.active);
}

TEST_F(TableIsolation, TwoAtOnce) {
  run(30, 1, 1, 1);
  run(10, 1.14, 1.1, 1);
  EXPECT_EQ((std::set<std::string>{name(first_), name(second_)}), (std::set<std::string>{kFriction, kMotor}));
}

TEST_F(TableIsolation, WhatIsNoSignatureIsUnknown) {
  run(30, 1, 1, 1);
  run(10, 0.7, 1.3, 0.75);
  EXPECT_TRUE(first_.active);
  EXPECT_EQ(first_.kind, AlarmKind::unknown);
  EXPECT_EQ(first_.effect, "");
}

TEST_F(TableIsolation, EstimatesThatAreNoNumbersSayNothing) {
  run(30, 1, 1, 1);
  bad_ = true;
  run(10, 1, 1, 1);
  EXPECT_FALSE(first_.active);
  bad_ = false;
  run(10, 1, 1, 1);
  EXPECT_FALSE(first_.active);
  run(4, 1.12, 1, 1);
  EXPECT_EQ(name(first_), kFriction);
}

TEST_F(TableIsolation, WhatItLearntCanBeKept) {
  run(30, 1, 1, 1);
  const auto learnt = one_->reference();
  ASSERT_TRUE(learnt);
  EXPECT_EQ(learnt->numbers.size(), 12u);
  EXPECT_NEAR(learnt->numbers[0], kTrue[0], 0.05);
  one_ = make_isolator(drive(), spec(1));
  one_->restore(*learnt);
  first_ = Finding();
  run(5, 1, 1.1, 1.1);  // from the first sample on
  EXPECT_EQ(name(first_), kBoth);
}

}  // namespace
}  // namespace faultline
