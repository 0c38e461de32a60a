// Divided difference filter of first (DD1) and second order (DD2), square-root form.
// Source: Norgaard, Poulsen, Ravn, "New developments in state estimation for nonlinear systems", Automatica 36 (2000);
// Mahulkar et al. 2011, equations (26)-(32) with their misprints mended: process noise stands in the a-priori root, K
// S_w in the a-posteriori root, and the correction is added.
//
// With step h (h^2 = 3 for Gaussian errors), s_p the columns of the root S of P, f_p+- = f(x +- h s_p), f_0 = f(x):
//   x-  = (h^2 - n)/h^2 f_0 + 1/(2 h^2) sum (f_p+ + f_p-)                       DD1: x- = f_0
//   S1  = (f_p+ - f_p-)/(2 h),   S2 = sqrt(h^2 - 1)/(2 h^2) (f_p+ + f_p- - 2 f_0)   DD1: no S2
//   S-  = triangle [S1 S2 S_v];  the same differences of h(x) with S- give Y1, Y2 and S_y = triangle [Y1 Y2 S_w]
//   K   = S- Y1' (S_y S_y')^-1,  x = x- + K (y - y-),  S = triangle [S- - K Y1, K S_w, K Y2]
// `triangle` is a Householder reduction: the covariance stays symmetric and positive by construction. Where y are
// plainly some of the states (ProcessModel::observed_states) Y2 is nothing and the correction is taken row by row
// instead, which is the same (observed_correction.h) at a tenth of the cost.
// Fails where the model returns something that is not finite: the state then is not finite either, and the stage
// restarts.
#pragma once

#include <Eigen/Core>

#include "faultline/estimators/state_estimator.h"

namespace faultline {

// States: the number of states, or Eigen::Dynamic for any up to kMaximumStates.
template <int States, int Order>
class DividedDifferenceFilter : public StateEstimator {
 public:
  explicit DividedDifferenceFilter(const ProcessModel& model);

  void reset(const double* state, const double* variance) override;
  void predict(double dt, double noise_scale) override;
  void correct(const double* y, const bool* use) override;

  const double* state() const override { return state_.data(); }
  void covariance(double* row_major) const override;
  const double* innovation() const override { return innovation_.data(); }
  const double* innovation_std() const override { return innovation_std_.data(); }
  double normalised_innovation() const override { return normalised_innovation_; }

 private:
  static constexpr bool kFixed = States != Eigen::Dynamic;
  static constexpr int kMost = kFixed ? States : kMaximumStates;
  static constexpr int kBlocks = Order == 2 ? 3 : 2;  // S1, S_v and, of second order, S2
  using Vector = Eigen::Matrix<double, States, 1, 0, kMost, 1>;
  using Outputs = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaximumOutputs, 1>;
  using Root = Eigen::Matrix<double, States, States, Eigen::RowMajor, kMost, kMost>;
  using Wide = Eigen::Matrix<double, States, kFixed ? kBlocks * States : Eigen::Dynamic, Eigen::RowMajor, kMost,
                             kBlocks * kMost>;
  using Corrected = Eigen::Matrix<double, States, Eigen::Dynamic, Eigen::RowMajor, kMost, 2 * kMost + kMaximumOutputs>;
  using OutputRoot =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor, kMaximumOutputs, kMaximumOutputs>;
  using OutputWide = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor, kMaximumOutputs,
                                   2 * kMost + kMaximumOutputs>;
  using Gain = Eigen::Matrix<double, States, Eigen::Dynamic, 0, kMost, kMaximumOutputs>;
  using Difference = Eigen::Matrix<double, Eigen::Dynamic, States, Eigen::RowMajor, kMaximumOutputs, kMost>;

  void correct_differences(const double* y, const int* rows, int m);  // of any h(x)
  void correct_observed(const double* y, const int* rows, int m);     // of y that are states

  const ProcessModel& model_;
  int n_, m_;
  std::vector<int> observed_;
  Vector process_root_, plus_, minus_, middle_, probe_, mean_;
  Outputs measurement_root_, y_plus_, y_minus_, y_middle_, y_mean_, innovation_, innovation_std_, solved_;
  Vector state_;
  Root root_;
  Wide wide_;
  Corrected corrected_;
  OutputWide output_wide_;
  OutputRoot output_root_;
  Difference first_, second_;
  Gain gain_;
  double normalised_innovation_ = 0;
};

}  // namespace faultline
