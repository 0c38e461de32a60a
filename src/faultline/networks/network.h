// A network of shape.h at work, sample by sample, and its derivatives by the weights. Signals are scaled by the caller
// to about 1.
//
//   z = [theta' s; d],   h = tanh(W1 z + b1),   y(k) = [y(k-1)] + g (W2 h + b2)
// Weights of a unit, one after the other: theta; W1, row after row; b1; then per output its row of W2 and its b2 (none
// where the unit integrates).
//
// Derivatives by forward sensitivities (real-time recurrent learning: Williams, Zipser, Neural Computation 1 (1989)):
//   dy(k)/dw = direct part + sum over taps on own estimates of dy(k)/dtap dy(k - lag)/dw
// exact over the whole run, with memory for the longest lag alone. They grow where the recurrence is unstable: that
// shows as numbers that are not finite. A step allocates nothing.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "faultline/networks/shape.h"

namespace faultline {

class Network {
 public:
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  // `sensitive`: step() also brings derivatives.
  explicit Network(const NetworkShape& shape, bool sensitive = false);

  const NetworkShape& shape() const { return shape_; }
  // As if the signals had always been these.
  void start(const double* inputs, const double* outputs);
  // Past estimates become what was measured then, or 0; without derivatives.
  void restart_measured() { restart(past_measured_); }
  void restart_cold() { restart(Eigen::MatrixXd::Zero(past_own_.rows(), past_own_.cols())); }
  // y(k) from the inputs at k and what is past.
  void step(const double* weights, const double* inputs);
  const Eigen::VectorXd& outputs() const { return y_; }
  // Outputs x weights, after step(); of unit u only the columns first(u) to end(u) can differ from 0.
  const Rows& sensitivities() const { return history_[0]; }
  std::size_t first(std::size_t unit) const { return shape_.feedback == Feedback::all ? 0 : offset_[unit]; }
  std::size_t end(std::size_t unit) const {
    return shape_.feedback == Feedback::all ? offset_.back() : offset_[unit + 1];
  }
  // y(k) no further than that; before take().
  void bound(const double* low, const double* high);
  // y(k) becomes past; `measured` at k.
  void take(const double* measured);

 private:
  struct Work {
    Eigen::VectorXd sum, z, h, g, c;
  };
  void restart(const Eigen::MatrixXd& past);
  bool fed_back(const Tap& tap, const NetworkUnit& unit) const;
  double value(const Tap& tap, const NetworkUnit& unit) const;
  double before(std::size_t output, const NetworkUnit& unit) const { return value({true, output, 1}, unit); }
  void differentiate(std::size_t place, const double* weights);

  NetworkShape shape_;
  bool sensitive_;
  std::size_t lags_;
  std::vector<std::size_t> offset_;                         // of each unit's weights; last: their number
  Eigen::MatrixXd past_inputs_, past_measured_, past_own_;  // signals x lags: column l is the sample l before
  Eigen::VectorXd y_;
  std::vector<Work> work_;
  std::vector<Rows> history_;  // of sensitivities, by lag
};

}  // namespace faultline
