// The contract of every state estimator: on a linear model it is Kalman's filter; the covariance stays symmetric and
// positive; the normalised innovation has the mean it must have; missing rows; a complete reset; nothing is allocated.
#include "faultline/estimators/state_estimator.h"

#include <gtest/gtest.h>

#include "allocations.h"
#include "estimators/linear_model.h"
#include "faultline/rig/driven_model.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

struct Case {
  const char* type;
  int states, outputs;
  bool selecting;
};

void PrintTo(const Case& c, std::ostream* out) {
  *out << c.type << " of " << c.states << " states, " << c.outputs
       << (c.selecting ? " of them measured" : " mixtures measured");
}

class EveryEstimator : public ::testing::TestWithParam<Case> {
 protected:
  LinearModel model_{GetParam().states, GetParam().outputs, GetParam().selecting, 5};
  std::unique_ptr<StateEstimator> filter_ = make_state_estimator(GetParam().type, model_);
  const int n_ = GetParam().states, m_ = GetParam().outputs;

  Eigen::MatrixXd covariance() const {
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> p(n_, n_);
    filter_->covariance(p.data());
    return p;
  }
};

TEST_P(EveryEstimator, IsKalmansFilterOnALinearModel) {
  TextbookKalman exact(model_);
  filter_->reset(model_.first.data(), model_.variance.data());
  Random random(8);
  double worst = 0;
  for (int k = 0; k < 2000; ++k) {
    model_.drive.setConstant(0.1 * std::sin(0.01 * k));
    double y[kMaximumOutputs];
    bool use[kMaximumOutputs];
    for (int i = 0; i < m_; ++i) y[i] = 3 * random.normal(), use[i] = random.uniform() > 0.2;
    filter_->predict(1e-3, 1);
    filter_->correct(y, use);
    exact.predict();
    exact.correct(y, use);
    const Eigen::MatrixXd p = covariance();
    for (int i = 0; i < n_; ++i) {
      worst = std::max(worst, std::abs(filter_->state()[i] - exact.x[i]));
      for (int j = 0; j < n_; ++j) worst = std::max(worst, std::abs(p(i, j) - exact.p(i, j)));
    }
    for (int i = 0; i < m_; ++i) {
      worst = std::max(worst, std::abs(filter_->innovation()[i] - exact.innovation[i]));
      worst = std::max(worst, std::abs(filter_->innovation_std()[i] - exact.std[i]));
    }
    worst = std::max(worst, std::abs(filter_->normalised_innovation() - exact.nis) / (1 + exact.nis));
  }
  EXPECT_LT(worst, 1e-9);
}

TEST_P(EveryEstimator, CovarianceStaysSymmetricAndPositive) {
  filter_->reset(model_.first.data(), model_.variance.data());
  Random random(2);
  double y[kMaximumOutputs];
  bool use[kMaximumOutputs];
  for (int k = 0; k < 100000; ++k) {
    for (int i = 0; i < m_; ++i) y[i] = random.normal(), use[i] = true;
    filter_->predict(1e-3, 1);
    filter_->correct(y, use);
    if (k % 5000 != 0) continue;
    const Eigen::MatrixXd p = covariance();
    ASSERT_EQ(p, p.transpose()) << k;
    ASSERT_GT(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(p).eigenvalues().minCoeff(), 0) << k;
  }
}

TEST_P(EveryEstimator, NormalisedInnovationHasTheMeanItMustHave) {
  // A truth drawn from the model itself: NIS is chi-squared with as many degrees of freedom as rows.
  filter_->reset(model_.first.data(), model_.variance.data());
  Random random(12);
  Eigen::VectorXd truth(n_);
  for (int i = 0; i < n_; ++i)
    truth[i] = model_.first[static_cast<std::size_t>(i)] +
               std::sqrt(model_.variance[static_cast<std::size_t>(i)]) * random.normal();
  double sum = 0;
  const int steps = 20000;
  bool use[kMaximumOutputs];
  std::fill_n(use, m_, true);
  for (int k = 0; k < steps; ++k) {
    truth = model_.a * truth;
    for (int i = 0; i < n_; ++i) truth[i] += std::sqrt(model_.q[static_cast<std::size_t>(i)]) * random.normal();
    Eigen::VectorXd y = model_.c * truth;
    for (int i = 0; i < m_; ++i) y[i] += std::sqrt(model_.r[static_cast<std::size_t>(i)]) * random.normal();
    filter_->predict(1e-3, 1);
    filter_->correct(y.data(), use);
    sum += filter_->normalised_innovation();
  }
  EXPECT_NEAR(sum / steps, m_, 4 * std::sqrt(2.0 * m_ / steps));
}

TEST_P(EveryEstimator, WithoutRowsNothingIsCorrected) {
  filter_->reset(model_.first.data(), model_.variance.data());
  filter_->predict(1e-3, 1);
  const std::vector<double> before(filter_->state(), filter_->state() + n_);
  const Eigen::MatrixXd p = covariance();
  const double y[kMaximumOutputs] = {1e300, 1e300, 1e300, 1e300, 1e300, 1e300, 1e300, 1e300};
  const bool use[kMaximumOutputs] = {};
  filter_->correct(y, use);
  EXPECT_EQ(std::vector<double>(filter_->state(), filter_->state() + n_), before);
  EXPECT_EQ(covariance(), p);
  EXPECT_EQ(filter_->normalised_innovation(), 0);
  for (int i = 0; i < m_; ++i) EXPECT_EQ(filter_->innovation()[i], 0);
}

TEST_P(EveryEstimator, LeftOutRowIsNeverRead) {
  filter_->reset(model_.first.data(), model_.variance.data());
  double y[kMaximumOutputs] = {0.5, std::nan(""), 0.1, 0.2};
  bool use[kMaximumOutputs] = {true, false, true, true};
  for (int k = 0; k < 10; ++k) {
    filter_->predict(1e-3, 1);
    filter_->correct(y, use);
  }
  for (int i = 0; i < n_; ++i) EXPECT_TRUE(std::isfinite(filter_->state()[i]));
  EXPECT_TRUE(std::isfinite(filter_->normalised_innovation()));
}

TEST_P(EveryEstimator, ResetIsComplete) {
  std::vector<double> first;
  for (int pass = 0; pass < 2; ++pass) {
    filter_->reset(model_.first.data(), model_.variance.data());
    Random random(4);
    bool use[kMaximumOutputs];
    double y[kMaximumOutputs];
    for (int k = 0; k < 50; ++k) {
      for (int i = 0; i < m_; ++i) y[i] = random.normal(), use[i] = true;
      filter_->predict(1e-3, 1);
      filter_->correct(y, use);
    }
    std::vector<double> all(filter_->state(), filter_->state() + n_);
    const Eigen::MatrixXd p = covariance();
    all.insert(all.end(), p.data(), p.data() + p.size());
    all.push_back(filter_->normalised_innovation());
    if (pass == 0)
      first = all;
    else
      EXPECT_EQ(all, first);
  }
}

// Beside another on the same model, whether its step serves or not.
TEST_P(EveryEstimator, BesideAnotherItPredictsAsAlone) {
  const std::unique_ptr<StateEstimator> leader = make_state_estimator(GetParam().type, model_),
                                        alone = make_state_estimator(GetParam().type, model_);
  leader->reset(model_.variance.data(), model_.variance.data());
  for (StateEstimator* filter : {filter_.get(), alone.get()})
    filter->reset(model_.first.data(), model_.variance.data());
  const double y[kMaximumOutputs] = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8};
  const bool use[kMaximumOutputs] = {true, false, true, true, true, true, true, true};
  for (int k = 0; k < 50; ++k) {
    model_.drive.setConstant(0.1 * std::sin(0.3 * k));
    model_.nears = k % 3 != 0;
    leader->predict(1e-3, 1);
    alone->predict(1e-3, 1);
    filter_->predict_beside(*leader, 1e-3, 1);
    leader->correct(y, use);
    for (StateEstimator* filter : {filter_.get(), alone.get()}) filter->correct(y, use);
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> p(n_, n_);
    alone->covariance(p.data());
    EXPECT_LT((covariance() - p).cwiseAbs().maxCoeff(), 1e-12);
    for (int i = 0; i < n_; ++i) EXPECT_NEAR(filter_->state()[i], alone->state()[i], 1e-12);
  }
}

TEST_P(EveryEstimator, AllocatesNothing) {
  filter_->reset(model_.first.data(), model_.variance.data());
  const double y[kMaximumOutputs] = {0.1, 0.2, 0.3, 0.4};
  const bool use[kMaximumOutputs] = {true, true, true, true};
  std::vector<double> p(static_cast<std::size_t>(n_ * n_));
  const std::uint64_t before = allocations();
  for (int k = 0; k < 100; ++k) {
    filter_->predict(1e-3, 1);
    filter_->correct(y, use);
    filter_->covariance(p.data());
  }
  filter_->reset(model_.first.data(), model_.variance.data());
  EXPECT_EQ(allocations() - before, 0u);
}

INSTANTIATE_TEST_SUITE_P(
    Linear, EveryEstimator,
    ::testing::Values(Case{"divided_difference_1", 6, 4, true}, Case{"divided_difference_1", 6, 4, false},
                      Case{"divided_difference_2", 6, 4, true}, Case{"divided_difference_2", 6, 4, false},
                      Case{"divided_difference_2", 4, 2, true}, Case{"divided_difference_2", 3, 3, false},
                      Case{"divided_difference_1", 11, 5, true}, Case{"divided_difference_2", 11, 5, true},
                      Case{"divided_difference_2", 11, 5, false}, Case{"divided_difference_2", 16, 8, false},
                      Case{"extended_kalman", 6, 4, true}, Case{"extended_kalman", 6, 4, false},
                      Case{"extended_kalman", 10, 5, true}, Case{"extended_kalman", 16, 8, false},
                      Case{"unscented_kalman", 3, 3, false}, Case{"unscented_kalman", 6, 4, true},
                      Case{"unscented_kalman", 6, 4, false}, Case{"unscented_kalman", 10, 5, true},
                      Case{"unscented_kalman", 16, 8, false}));

TEST(DividedDifference, SecondOrderBeatsFirstOnASquare) {
  // y = x^2 with a wide first guess: the first order misses E(y) = x^2 + P and trusts its answer too much. Known in
  // closed form for one correction: S_y = 4 x^2 P + 2 P^2 + R to second order, mean x^2 + P.
  SquareModel model;
  const auto dd1 = make_state_estimator("divided_difference_1", model),
             dd2 = make_state_estimator("divided_difference_2", model);
  const double x0 = 1, p0 = 0.09;
  const bool use = true;
  double y = 1.3;
  for (auto* filter : {dd1.get(), dd2.get()}) {
    filter->reset(&x0, &p0);
    filter->correct(&y, &use);
  }
  EXPECT_NEAR(dd1->innovation()[0], y - 1, 1e-12);
  EXPECT_NEAR(dd2->innovation()[0], y - 1 - 0.09, 1e-12);
  EXPECT_NEAR(dd1->innovation_std()[0], std::sqrt(4 * 0.09 + 1e-4), 1e-12);
  EXPECT_NEAR(dd2->innovation_std()[0], std::sqrt(4 * 0.09 + 2 * 0.0081 + 1e-4), 1e-12);

  Random random(6);
  double error1 = 0, error2 = 0, excess1 = 0, excess2 = 0;
  const int runs = 2000;
  for (int run = 0; run < runs; ++run) {
    double truth = x0 + std::sqrt(p0) * random.normal();
    dd1->reset(&x0, &p0);
    dd2->reset(&x0, &p0);
    for (int k = 0; k < 3; ++k) {
      y = truth * truth + 0.01 * random.normal();
      for (auto* filter : {dd1.get(), dd2.get()}) {
        filter->predict(1e-3, 1);
        filter->correct(&y, &use);
      }
    }
    double p = 0;
    error1 += std::pow(dd1->state()[0] - truth, 2);
    dd1->covariance(&p);
    excess1 += std::pow(dd1->state()[0] - truth, 2) / p;
    error2 += std::pow(dd2->state()[0] - truth, 2);
    dd2->covariance(&p);
    excess2 += std::pow(dd2->state()[0] - truth, 2) / p;
  }
  EXPECT_LT(excess2, 0.1 * excess1);  // how far it is from what it believes
  EXPECT_LT(error2, 0.5 * error1);
}

TEST(UnscentedKalman, OnASquareItKnowsWhatTheSecondOrderKnows) {
  // The same closed form as above: with one state the points match the fourth moment.
  SquareModel model;
  const auto filter = make_state_estimator("unscented_kalman", model);
  const double x0 = 1, p0 = 0.09, y = 1.3;
  const bool use = true;
  filter->reset(&x0, &p0);
  filter->correct(&y, &use);
  EXPECT_NEAR(filter->innovation()[0], y - 1 - 0.09, 1e-12);
  EXPECT_NEAR(filter->innovation_std()[0], std::sqrt(4 * 0.09 + 2 * 0.0081 + 1e-4), 1e-12);
}

TEST(ExtendedKalman, RefusesAModelWithoutJacobian) {
  SquareModel model;
  EXPECT_THROW(make_state_estimator("extended_kalman", model), InputError);
}

// A random walk driven by one measured input: the noise of that input must reach the state through G.
class DrivenModel : public LinearModel {
 public:
  DrivenModel() : LinearModel(2, 1, true, 3) {}
  std::vector<double> input_noise() const override { return {0.25}; }
  void input_jacobian(const double*, double, double* g) const override { g[0] = 2, g[1] = -1; }
};

TEST(InputNoise, IsMappedThroughG) {
  DrivenModel driven;
  for (const char* type : {"extended_kalman", "unscented_kalman"}) {
    const auto filter = make_state_estimator(type, driven);
    filter->reset(driven.first.data(), driven.variance.data());
    filter->predict(1e-3, 1);
    Eigen::Matrix2d p, q = Eigen::Vector2d(driven.q[0], driven.q[1]).asDiagonal();
    Eigen::Matrix<double, 2, 2, Eigen::RowMajor> heard;
    filter->covariance(heard.data());
    const Eigen::Vector2d g(2, -1);
    p = driven.a * Eigen::Vector2d(driven.variance[0], driven.variance[1]).asDiagonal() * driven.a.transpose() + q +
        0.25 * g * g.transpose();
    EXPECT_LT((heard - p).cwiseAbs().maxCoeff(), 1e-12) << type;
  }
}

TEST(StateEstimator, UnknownTypeIsRefusedWithTheKnownOnes) {
  SquareModel model;
  try {
    make_state_estimator("particle", model);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("divided_difference_2"), std::string::npos);
  }
}

}  // namespace
}  // namespace faultline
