// Bilinear fault detection observer with unknown inputs, of fixed gain. Its innovation is what the known part of a rig
// cannot explain, whatever the unknown inputs do. decoupling.h has the equations and the sources.
//
// Between samples (Runge-Kutta; measured inputs and outputs linear, commands held):
//   w^' = T (A + sum u_i A_i)(M w^ + N y) + T B u
// at a sample:  r = z - H w^,  w^ += K r,   K the steady Kalman gain in the middle of the inputs' range: of process
// noise, of the measurement noise in z, and of that of y where it drives w.
//
// A real rig's parameters are off the datasheet's, so r is not zero on a healthy one. To first order
//   r = sum over j of g_j theta_j + noise,   s_j' = T (A + sum u_i A_i) M s_j + d(w^')/dtheta_j,   g_j = H s_j
// corrected at samples as the error is, with theta_j the deviation of a parameter in units of its tolerance. Over the
// first `learn` s theta is fitted by least squares with the tolerances as prior, the equations being made linear around
// it every kBlock s (products of parameters count: 20 % off in one of them scales the other's g_j); then it is kept:
// the residual is r - g theta
// and its variance (1 + g' P g) times that of the noise found meanwhile. With `learn` 0 nothing is taken off and the
// variance is what the tolerances allow: the best there is without a healthy run. A fault that is there from the start
// is learnt as normal. Parameters are taken as constant: what friction and entrained air do beyond that stays in the
// noise. Learning takes a finite time, in which a rig need not show all that it does: the noise
// is the mean over blocks of kBlock s and kMargin standard errors more, and blocks that are not kSame times as large go
// on to be learnt from. A change as small as that is for those who follow theta.
//
// With `forgetting` theta is followed on by least squares with forgetting, from the first sample on, and told as the
// state, each in its own unit, with the covariance that white noise gives: a change of a parameter that is too small
// for the size of the residual shows in them (isolation/signature_table_isolator.cpp). Learning samples are then
// observed too, but for the first third.
//
// Throws InputError where the unknown inputs cannot be decoupled, leave no residual, or leave what no gain makes
// stable, with the reason. Settings: model, unknown (states whose equations are acted upon by unknown inputs, with
// commas; empty: none), process_noise (one per state, in its unit per sqrt(s)), learn (s), learnt (parameters with a
// tolerance, with commas), forgetting [theta is not followed].
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "faultline/estimators/bilinear_model.h"
#include "faultline/estimators/decoupling.h"
#include "faultline/estimators/estimator.h"
#include "faultline/estimators/recursive_least_squares.h"

namespace faultline {

class BilinearObserver : public Estimator {
 public:
  BilinearObserver(const Datasheet& sheet, const StageSpec& spec);

  std::vector<State> states() const override { return followed_states_; }  // parameters that are followed
  std::vector<std::string> innovation_names() const override;
  void begin(const double* channels) override;
  bool advance(const double* channels, const ChannelStatus* status, double dt, int steps) override;
  void write(const double* channels, bool begun, Estimate& estimate) const override;

  const Decoupling& decoupling() const { return decoupling_; }
  // w^' for given w^, y and u: for checks against the rig's own equations.
  Eigen::VectorXd rate(const Eigen::VectorXd& w, const Eigen::VectorXd& y, const Eigen::VectorXd& u) const;

 private:
  // Row blocks: w^' itself, then its derivatives by the parameters learnt. Columns: w^, then y; inputs.
  struct Equations {
    Eigen::MatrixXd kernel, drive;
    std::vector<Eigen::MatrixXd> products;
  };
  Equations equations_at(const std::vector<double>& parameters) const;
  void build();
  void make_linear(const double* theta);
  void find_gain(const Settings& settings);
  void read(const double* channels);
  void equations(double fraction);  // at this fraction of the way from the last sample to this one
  void slope(const Eigen::MatrixXd& state, Eigen::MatrixXd& rate);
  void step(double dt, double from, double to);
  void learn(double dt);
  void learn_noise(double dt);

  std::unique_ptr<BilinearModel> model_;
  std::vector<BilinearInput> inputs_;
  std::vector<Channel> channels_;
  std::vector<int> measured_, used_, learnt_;
  std::vector<double> nominal_, tolerance_;  // of all parameters; of those learnt, in their unit
  double period_, learn_;
  Decoupling decoupling_;
  Equations at_nominal_;
  std::vector<Equations> by_parameter_;  // change of them with one tolerance more of a parameter
  std::vector<double> around_;           // theta around which they are linear now
  Eigen::MatrixXd kernel_, drive_;
  std::vector<Eigen::MatrixXd> products_;
  Eigen::MatrixXd gain_;
  Eigen::VectorXd innovation_std_;
  int substeps_ = 1, settle_ = 1;  // steps a sample; samples

  Eigen::VectorXd u_, y_, u_before_, y_before_, u_now_, y_now_, wy_, stacked_;
  Eigen::MatrixXd now_, state_, tried_, k1_, k2_, k3_, k4_, sensitivity_;
  RecursiveLeastSquares fit_;
  std::optional<RecursiveLeastSquares> followed_;
  std::vector<State> followed_states_;
  double noise_variance_ = 1, learnt_for_ = 0;
  // Mean square of a block, over the healthy blocks so far.
  double block_ = 0, block_rows_ = 0, block_for_ = 0, blocks_ = 0, blocks_sum_ = 0, blocks_square_ = 0;
  int steady_ = 0;  // samples since all channels were good
  Eigen::VectorXd residual_, residual_std_;
  int observed_ = 0;
};

}  // namespace faultline
