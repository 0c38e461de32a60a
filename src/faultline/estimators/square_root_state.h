// What Kalman filters in square-root form share: the state, a root S of its covariance P = S S', noise roots, and
// corrections by rows whose measurement is linear in the state (row_correction.h).
//
// A filter writes its propagated columns into `wide` and calls add_noise(), which puts G sqrt(Q_u) and sqrt(Q) behind
// them and reduces all to the new root. Sizes are the model's; nothing is allocated after the constructor.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "faultline/estimators/process_model.h"

namespace faultline {

struct SquareRootState {
  static constexpr int kColumns = 3 * kMaximumStates + 1 + kMaximumNoisyInputs;
  using State = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaximumStates, 1>;
  using Outputs = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaximumOutputs, 1>;
  using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor, kMaximumStates, kMaximumStates>;
  using Observation =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor, kMaximumOutputs, kMaximumStates>;
  using Inputs =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor, kMaximumStates, kMaximumNoisyInputs>;
  using Wide = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor, kMaximumStates, kColumns>;

  // `propagated`: columns that the filter writes into `wide`, in multiples of n, plus `extra`.
  SquareRootState(const ProcessModel& of, int propagated, int extra = 0);

  void reset(const double* first, const double* variance);
  void propagate(const Square& a);                // a S, the first columns of `wide`
  void add_noise(double dt, double noise_scale);  // of the inputs at `state`, before it is replaced
  // `predicted` must hold h(x-).
  void correct_rows(const double* y, const bool* use, const Observation& c);
  void correct_observed(const double* y, const bool* use);  // y are the states `observed`
  void covariance(double* row_major) const;

  const ProcessModel& model;
  int n, m, inputs, columns;
  std::vector<int> observed;
  State state, process_root;
  Outputs measurement_variance, predicted, innovation, innovation_std;
  Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaximumNoisyInputs, 1> input_root;
  Inputs g;
  Square root;
  Wide wide;
  double normalised_innovation = 0;
};

}  // namespace faultline
