// The bilinear observer on systems made by hand: when an unknown input can be decoupled, that the residual then does
// not move under it, that a changed parameter moves it and is learnt, and what bad samples do.
#include <cmath>
#include <functional>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "allocations.h"
#include "faultline/estimators/bilinear_observer.h"
#include "faultline/estimators/estimator_stage.h"
#include "faultline/numerics/random.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

constexpr double kPeriod = 0.01;

// x' = (A + u_1 A_1) x + B u, y = (x_1 + x_2, x_3): x_4 is not measured. `gain` multiplies B, `stiff` A_1. `measured`:
// the product takes a measured state only.
struct Made {
  Matrix a{4, 4}, product = Matrix::Zero(4, 4), b{4, 2}, c = Matrix::Zero(2, 4);
  explicit Made(bool measured) {
    Random random(5);
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) a(i, j) = (i == j ? -3.0 - i : 0.0) + random.uniform(-1, 1);
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 2; ++j) b(i, j) = random.uniform(-1, 1);
    product(0, measured ? 2 : 3) = 0.8;
    product(1, measured ? 2 : 3) = -0.5;
    c(0, 0) = c(0, 1) = c(1, 2) = 1;
  }
};

template <bool measured>
class MadeModel : public BilinearModel {
 public:
  MadeModel(const Datasheet&, const Settings&) {}
  std::vector<State> states() const override {
    return {{"one", "x_1", "1"}, {"two", "x_2", "1"}, {"three", "x_3", "1"}, {"four", "x_4", "1"}};
  }
  std::vector<BilinearInput> inputs() const override { return {{"u_1", "1", false, -1, 1}, {"u_2", "1", true, -1, 1}}; }
  std::vector<int> measured_channels() const override { return {0, 1}; }
  std::vector<int> driving_channels() const override { return {2, 3}; }
  BilinearSystem system(const std::vector<double>& p) const override {
    const Made made(measured);
    return {made.a, {p[1] * made.product, Matrix()}, p[0] * made.b, made.c};
  }
  void take_inputs(const double* channels, double* u) const override { u[0] = channels[2], u[1] = channels[3]; }
};
FAULTLINE_BILINEAR_MODEL(made, {"made", make_bilinear_model_of<MadeModel<false>>});
FAULTLINE_BILINEAR_MODEL(made_strict, {"made_strict", make_bilinear_model_of<MadeModel<true>>});

const Datasheet& sheet() {
  static const Datasheet made = [] {
    Datasheet s;
    s.file = "made.yaml";
    s.sample_period = kPeriod;
    for (const char* name : {"sum", "third", "first_input", "second_input"}) {
      Channel c;
      c.name = name;
      c.unit = "1";
      c.minimum = -100;
      c.maximum = 100;
      c.noise_std = 1e-4;
      s.channels.push_back(c);
    }
    for (const char* name : {"gain", "stiff"}) {
      Parameter p;
      p.name = name;
      p.nominal = 1;
      p.tolerance = 0.1;
      s.parameters.push_back(p);
    }
    return s;
  }();
  return made;
}

StageSpec spec(const std::string& model, const std::string& unknown, double learn = 0, const std::string& learnt = "") {
  StageSpec s;
  s.name = "observer";
  s.type = "bilinear_observer";
  s.settings = Settings("made.yaml:1: estimators.observer", {{"learn", learn}},
                        {{"process_noise", {3e-4, 3e-4, 3e-4, 3e-4}}}, {{"model", model}, {"unknown", unknown}});
  if (!learnt.empty()) s.settings.set("learnt", learnt);
  return s;
}

std::string refused(const std::string& unknown) {
  try {
    BilinearObserver observer(sheet(), spec("made", unknown));
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(Decoupling, ExistsWhereTheOutputsSeeTheUnknownInput) {
  const Made made(false);
  const BilinearSystem system = {made.a, {made.product, Matrix()}, made.b, made.c};
  const std::vector<std::pair<std::vector<int>, bool>> cases = {
      {{}, true}, {{0}, true}, {{2}, true}, {{3}, false}, {{0, 2}, true}, {{0, 1}, false}, {{2, 3}, false}};
  for (const auto& [unknown, exists] : cases) {
    const Decoupling d = decouple(system, unknown);
    ASSERT_EQ(d.exists, exists);
    if (!exists) continue;
    EXPECT_EQ(d.t.rows(), 4 - static_cast<int>(unknown.size()));
    EXPECT_EQ(d.h.rows(), 2 - static_cast<int>(unknown.size()));
    EXPECT_LT((d.m * d.t + d.n * made.c - Matrix::Identity(4, 4)).norm(), 1e-14);
    for (const int state : unknown) {
      EXPECT_LT((d.t.col(state)).norm(), 1e-15);
      EXPECT_LT((d.w * made.c.col(state)).norm(), 1e-15);
    }
    EXPECT_FALSE(d.strict);
    EXPECT_EQ(d.varying, std::vector<int>{0});
  }
}

TEST(Decoupling, StrictWhereTheProductTakesMeasuredStates) {
  const Made made(true);
  const BilinearSystem system = {made.a, {made.product, Matrix()}, made.b, made.c};
  EXPECT_TRUE(decouple(system, {2}).strict);  // x_3 is then taken from y
  EXPECT_FALSE(decouple(system, {}).strict);  // and here filtered
  EXPECT_FALSE(decouple(system, {0}).strict);
}

TEST(Decoupling, WhatCannotBeIsToldWithItsReason) {
  EXPECT_NE(refused("four").find("rank(C E) < rank(E)"), std::string::npos);
  EXPECT_NE(refused("one, three").find("no residual is left"), std::string::npos);
  EXPECT_NE(refused("five").find("no state of the model"), std::string::npos);
  EXPECT_EQ(refused("three"), "");
}

TEST(Decoupling, WhatNoGainHoldsStableIsRefused) {
  // x_4 grows and shows in nothing.
  struct Blind : MadeModel<true> {
    using MadeModel<true>::MadeModel;
    BilinearSystem system(const std::vector<double>& p) const override {
      BilinearSystem s = MadeModel<true>::system(p);
      s.a.col(3).setZero();
      s.a(3, 3) = 0.5;
      return s;
    }
  };
  static const bool added = registry<BilinearModelType>().add({"made_blind", make_bilinear_model_of<Blind>});
  ASSERT_TRUE(added);
  EXPECT_THROW(BilinearObserver(sheet(), spec("made_blind", "three")), InputError);
}

TEST(BilinearObserver, ItsRateIsTheSystemsWhateverTheUnknownInput) {
  const Made made(false);
  for (const auto& [unknown, state] : std::vector<std::pair<std::string, int>>{{"three", 2}, {"one", 0}}) {
    const BilinearObserver observer(sheet(), spec("made", unknown));
    const Decoupling& d = observer.decoupling();
    Random random(3);
    for (int k = 0; k < 100; ++k) {
      Vector x(4), u(2);
      for (int i = 0; i < 4; ++i) x[i] = random.uniform(-5, 5);
      for (int i = 0; i < 2; ++i) u[i] = random.uniform(-1, 1);
      Vector rate = (made.a + u[0] * made.product) * x + made.b * u;
      rate[state] += random.uniform(-1e3, 1e3);
      EXPECT_LT((observer.rate(d.t * x, made.c * x, u) - d.t * rate).norm(), 1e-12);
    }
  }
}

// The rig with x_3 as given: some unknown input makes it so. In the observer's own steps, so that rounding is all that
// lies between the two.
class MadeRig {
 public:
  MadeRig(double gain, double stiff, std::function<double(int)> third, std::uint64_t seed, double noise = 0)
      : made_(false), gain_(gain), stiff_(stiff), third_(std::move(third)), random_(seed), noise_(noise) {
    x_[2] = third_(0);
    for (int i = 0; i < 2; ++i) u_[i] = 0;
    // A long time of the first inputs.
    for (int i = 0; i < 3000; ++i) advance(u_, u_, x_[2], x_[2]);
  }
  Sample step() {
    Sample s;
    s.time = kPeriod * k_;
    s.sequence = static_cast<std::uint64_t>(k_);
    if (k_ > 0) {
      Vector next(2);
      next << std::sin(0.03 * k_) + 0.3 * std::sin(0.171 * k_), (k_ / 70) % 2 ? 0.8 : -0.4;
      advance(u_, next, third_(k_ - 1), third_(k_));
      u_ = next;
    }
    ++k_;
    s.values = {x_[0] + x_[1] + noise_ * random_.normal(), x_[2] + noise_ * random_.normal(), u_[0], u_[1]};
    return s;
  }
  void set_gain(double gain) { gain_ = gain; }

 private:
  void advance(const Vector& from, const Vector& to, double third, double third_after) {
    constexpr int kSubsteps = 1;
    const double h = kPeriod / kSubsteps;
    const auto rate = [&](Vector x, double f) {
      x[2] = third + f * (third_after - third);
      Vector u = from;
      u[0] += f * (to[0] - from[0]);
      return Vector((made_.a + stiff_ * u[0] * made_.product) * x + gain_ * made_.b * u);
    };
    for (int i = 0; i < kSubsteps; ++i) {
      const double f = static_cast<double>(i) / kSubsteps, m = f + 0.5 / kSubsteps, e = f + 1.0 / kSubsteps;
      const Vector k1 = rate(x_, f), k2 = rate(x_ + 0.5 * h * k1, m), k3 = rate(x_ + 0.5 * h * k2, m);
      const Vector k4 = rate(x_ + h * k3, e);
      x_ += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
    }
    x_[2] = third_after;
  }
  Made made_;
  double gain_, stiff_;
  std::function<double(int)> third_;
  Random random_;
  double noise_;
  Vector x_ = Vector::Zero(4), u_ = Vector::Zero(2);
  int k_ = 0;
};

double calm(int) { return 0.2; }
double wild(int k) { return 20 * std::sin(0.2 * k) + (k > 300 ? 30.0 : 0.0) + (k % 7); }

std::vector<double> residuals(EstimatorStage& stage, MadeRig& rig, int samples) {
  std::vector<double> result;
  Estimate estimate;
  for (int k = 0; k < samples; ++k) {
    EXPECT_TRUE(stage.process(rig.step(), estimate));
    result.push_back(estimate.innovation[0]);
  }
  return result;
}

TEST(BilinearObserver, ResidualDoesNotMoveUnderTheUnknownInput) {
  for (const auto& third : {calm, wild}) {
    EstimatorStage stage(sheet(), spec("made", "three"));
    MadeRig rig(1, 1, third, 1);
    double most = 0;
    for (const double r : residuals(stage, rig, 1000)) most = std::max(most, std::abs(r));
    EXPECT_LT(most, 1e-11);
  }
  // Without decoupling the wild one moves it far.
  EstimatorStage stage(sheet(), spec("made", ""));
  MadeRig rig(1, 1, wild, 1);
  double most = 0;
  for (const double r : residuals(stage, rig, 1000)) most = std::max(most, std::abs(r));
  EXPECT_GT(most, 0.1);
}

TEST(BilinearObserver, NormalisedResidualOfNoiseIsOfVarianceOne) {
  EstimatorStage stage(sheet(), spec("made", "three"));
  MadeRig rig(1, 1, calm, 1, 1e-4);
  Estimate estimate;
  double sum = 0;
  int count = 0;
  for (int k = 0; k < 20000; ++k) {
    ASSERT_TRUE(stage.process(rig.step(), estimate));
    if (estimate.observed == 0) continue;
    sum += estimate.normalised_innovation, ++count;
  }
  EXPECT_GT(count, 19000);
  // process_noise is what it allows for beyond the noise there is: less than one.
  EXPECT_GT(sum / count, 0.05);
  EXPECT_LT(sum / count, 1.1);
}

TEST(BilinearObserver, LearnsToleranceAndThenSeesAChange) {
  // 8 % off in one parameter, 5 % in another: after learning the residual is noise; a further 3 % shows.
  EstimatorStage stage(sheet(), spec("made", "three", 20, "gain, stiff"));
  EstimatorStage without(sheet(), spec("made", "three"));
  MadeRig rig(1.08, 0.95, wild, 2, 1e-4);
  Estimate estimate, other;
  double quiet = 0, loud = 0, unlearnt = 0;
  for (int k = 0; k < 8000; ++k) {
    if (k == 5000) rig.set_gain(1.08 * 1.03);
    const Sample s = rig.step();
    ASSERT_TRUE(stage.process(s, estimate));
    ASSERT_TRUE(without.process(s, other));
    if (k < 1990) {
      ASSERT_EQ(estimate.observed, 0) << k;
    }
    if (k > 2500 && k < 5000) {
      quiet += estimate.normalised_innovation / 2500;
      unlearnt += std::pow(other.innovation[0], 2) / 2500;
    }
    if (k > 5100) loud += estimate.normalised_innovation / 2900;
  }
  EXPECT_GT(quiet, 0.5);
  EXPECT_LT(quiet, 2);
  EXPECT_GT(loud, 5 * quiet);
  EXPECT_GT(unlearnt, 1e-6);  // ten times the noise: what the tolerances do without learning
}

TEST(BilinearObserver, FollowsWhatItLearntAndTellsItsError) {
  // Both parameters are off by far; a change of 1 % of one shows in it alone, within what its covariance says.
  StageSpec following = spec("made", "three", 10, "gain, stiff");
  following.settings.set("forgetting", 0.98);
  EstimatorStage stage(sheet(), following);
  ASSERT_EQ(stage.states().size(), 2u);
  EXPECT_EQ(stage.states()[1].name, "stiff");
  MadeRig rig(1.15, 0.8, wild, 2, 1e-4);
  Estimate estimate;
  double error[2] = {}, square[2] = {}, count = 0;
  for (int k = 0; k < 9000; ++k) {
    if (k == 5000) rig.set_gain(1.15 * 1.01);
    ASSERT_TRUE(stage.process(rig.step(), estimate));
    if (k < 1500 || (k >= 5000 && k < 5500)) continue;
    const double truth[] = {k < 5000 ? 1.15 : 1.15 * 1.01, 0.8};
    ++count;
    for (std::size_t i = 0; i < 2; ++i) {
      const double off = estimate.state[i] - truth[i];
      error[i] += off;
      square[i] += off * off / estimate.covariance[3 * i];
    }
  }
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_LT(std::abs(error[i] / count), 2e-3) << i;
    EXPECT_LT(square[i] / count, 4) << i;
    EXPECT_GT(square[i] / count, 0.1) << i;
  }
}

TEST(BilinearObserver, ABadSampleIsNotToldAndDoesNotStay) {
  EstimatorStage stage(sheet(), spec("made", "three"));
  MadeRig rig(1, 1, calm, 1);
  Estimate estimate;
  double worst = 0;
  for (int k = 0; k < 1500; ++k) {
    Sample s = rig.step();
    if (k >= 700 && k < 710) s.values[static_cast<std::size_t>(k % 4)] = std::nan("");
    if (k == 720) continue;  // one is lost
    ASSERT_TRUE(stage.process(s, estimate));
    if (k >= 700 && k < 710) {
      EXPECT_EQ(estimate.observed, 0);
      EXPECT_EQ(estimate.innovation[0], 0);
    }
    if (k > 730) worst = std::max(worst, estimate.observed * std::abs(estimate.innovation[0]));
    ASSERT_TRUE(std::isfinite(estimate.innovation[0]));
  }
  EXPECT_GT(estimate.observed, 0);
  EXPECT_LT(worst, 5e-3);
}

TEST(BilinearObserver, AStepAllocatesNothing) {
  StageSpec following = spec("made", "three", 1, "gain, stiff");
  following.settings.set("forgetting", 0.98);
  EstimatorStage stage(sheet(), following);
  MadeRig rig(1, 1, calm, 1);
  std::vector<Sample> samples;
  for (int k = 0; k < 500; ++k) samples.push_back(rig.step());
  Estimate estimate;
  for (int k = 0; k < 10; ++k) stage.process(samples[static_cast<std::size_t>(k)], estimate);
  const std::uint64_t before = allocations();
  for (std::size_t k = 10; k < samples.size(); ++k) stage.process(samples[k], estimate);
  EXPECT_EQ(allocations() - before, 0u);
}

}  // namespace
}  // namespace faultline
