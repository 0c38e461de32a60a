// Models with known answers for tests of estimators: a linear one of any size, whose exact filter is Kalman's, and one
// whose measurement is a square.
#pragma once

#include <cmath>
#include <vector>

#include <Eigen/Dense>

#include "faultline/estimators/process_model.h"
#include "faultline/numerics/random.h"

namespace faultline {

// x+ = A x + B u, y = C x. B u is one vector, set by hand.
class LinearModel : public ProcessModel {
 public:
  // `selecting`: y are the first states, and the model says so.
  LinearModel(int states, int outputs, bool selecting, std::uint64_t seed) : selecting_(selecting) {
    Random random(seed);
    a = Eigen::MatrixXd::Identity(states, states);
    for (int i = 0; i < states; ++i)
      for (int j = 0; j < states; ++j) a(i, j) = (i == j ? 0.9 : 0) + 0.4 / states * random.uniform(-1, 1);
    c = Eigen::MatrixXd::Zero(outputs, states);
    for (int i = 0; i < outputs; ++i)
      for (int j = 0; j < states; ++j) c(i, j) = selecting ? (i == j ? 1.0 : 0.0) : random.uniform(-1, 1);
    drive = Eigen::VectorXd::Zero(states);
    for (int i = 0; i < states; ++i) q.push_back(0.01 * (1 + i)), first.push_back(0.1 * i), variance.push_back(1.0 + i);
    for (int i = 0; i < outputs; ++i) r.push_back(0.04 * (1 + i));
  }

  std::vector<State> states() const override {
    return std::vector<State>(static_cast<std::size_t>(a.rows()), State{"state", "x", "1"});
  }
  std::vector<int> measured_channels() const override {
    std::vector<int> rows;
    for (int i = 0; i < c.rows(); ++i) rows.push_back(i);
    return rows;
  }
  std::vector<int> driving_channels() const override { return {}; }
  std::vector<double> process_noise() const override { return q; }
  std::vector<double> measurement_noise() const override { return r; }
  void initial(const double*, double* state, double* diagonal) const override {
    std::copy(first.begin(), first.end(), state);
    std::copy(variance.begin(), variance.end(), diagonal);
  }
  void take_inputs(const double*) override {}
  void measurement(const double* channels, double* y) const override { std::copy_n(channels, c.rows(), y); }
  void predict(const double* x, double, double* next) const override {
    Eigen::Map<Eigen::VectorXd>(next, a.rows()).noalias() =
        a.lazyProduct(Eigen::Map<const Eigen::VectorXd>(x, a.rows())) + drive;
  }
  void observe(const double* x, double* y) const override {
    Eigen::Map<Eigen::VectorXd>(y, c.rows()).noalias() = c.lazyProduct(Eigen::Map<const Eigen::VectorXd>(x, a.rows()));
  }
  std::vector<int> observed_states() const override { return selecting_ ? measured_channels() : std::vector<int>(); }
  bool near(const double*, const double*) const override { return nears; }
  bool jacobian(const double*, double, double* out) const override {
    Eigen::Map<Eigen::Matrix<double, -1, -1, Eigen::RowMajor>>(out, a.rows(), a.cols()) = a;
    return true;
  }
  bool observe_jacobian(const double*, double* out) const override {
    Eigen::Map<Eigen::Matrix<double, -1, -1, Eigen::RowMajor>>(out, c.rows(), c.cols()) = c;
    return true;
  }
  void quantities(const double*, const double*, const double*, std::vector<Quantity>&) const override {}

  Eigen::MatrixXd a, c;
  Eigen::VectorXd drive;
  std::vector<double> q, r, first, variance;
  bool nears = false;

 private:
  bool selecting_;
};

// Kalman's filter as in any textbook, with full matrices: P = A P A' + Q; K = P C' (C P C' + R)^-1; P = (I - K C) P.
class TextbookKalman {
 public:
  explicit TextbookKalman(const LinearModel& model) : model_(model) {
    x = Eigen::Map<const Eigen::VectorXd>(model.first.data(), model.a.rows());
    p = Eigen::Map<const Eigen::VectorXd>(model.variance.data(), model.a.rows()).asDiagonal();
  }
  void predict() {
    x = model_.a * x + model_.drive;
    const Eigen::MatrixXd q = Eigen::Map<const Eigen::VectorXd>(model_.q.data(), x.size()).asDiagonal();
    p = model_.a * p * model_.a.transpose() + q;
  }
  void correct(const double* y, const bool* use) {
    std::vector<Eigen::Index> rows;
    for (Eigen::Index i = 0; i < model_.c.rows(); ++i)
      if (use[i]) rows.push_back(i);
    nis = 0;
    innovation = std = Eigen::VectorXd::Zero(model_.c.rows());
    if (rows.empty()) return;
    const auto m = static_cast<Eigen::Index>(rows.size());
    Eigen::MatrixXd c(m, x.size()), r = Eigen::MatrixXd::Zero(m, m);
    Eigen::VectorXd off(m);
    for (Eigen::Index i = 0; i < m; ++i) {
      const Eigen::Index row = rows[static_cast<std::size_t>(i)];
      c.row(i) = model_.c.row(row);
      r(i, i) = model_.r[static_cast<std::size_t>(row)];
      off[i] = y[row] - model_.c.row(row).dot(x);
    }
    const Eigen::MatrixXd s = c * p * c.transpose() + r;
    const Eigen::MatrixXd gain = p * c.transpose() * s.inverse();
    for (Eigen::Index i = 0; i < m; ++i) {
      innovation[rows[static_cast<std::size_t>(i)]] = off[i];
      std[rows[static_cast<std::size_t>(i)]] = std::sqrt(s(i, i));
    }
    nis = off.dot(s.inverse() * off);
    x += gain * off;
    p = (Eigen::MatrixXd::Identity(x.size(), x.size()) - gain * c) * p;
  }

  Eigen::VectorXd x, innovation, std;
  Eigen::MatrixXd p;
  double nis = 0;

 private:
  const LinearModel& model_;
};

// One state, a slow random walk; measured is its square.
class SquareModel : public ProcessModel {
 public:
  std::vector<State> states() const override { return {{"state", "x", "1"}}; }
  std::vector<int> measured_channels() const override { return {0}; }
  std::vector<int> driving_channels() const override { return {}; }
  std::vector<double> process_noise() const override { return {1e-6}; }
  std::vector<double> measurement_noise() const override { return {1e-4}; }
  void initial(const double*, double* state, double* diagonal) const override { state[0] = 1, diagonal[0] = 0.09; }
  void take_inputs(const double*) override {}
  void measurement(const double* channels, double* y) const override { y[0] = channels[0]; }
  void predict(const double* x, double, double* next) const override { next[0] = x[0]; }
  void observe(const double* x, double* y) const override { y[0] = x[0] * x[0]; }
  void quantities(const double*, const double*, const double*, std::vector<Quantity>&) const override {}
};

}  // namespace faultline
