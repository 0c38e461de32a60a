// When did estimated parameters step away from a reference, and by how much: generalised likelihood ratio over the time
// of the step.
// Source: Basseville, Nikiforov, Detection of Abrupt Changes (1993), chapter 2.4.3 (unknown time and size of change).
//
// Estimates theta_k with covariance P_k, each of about the last `memory` s (least squares with forgetting), carry the
// information (T/memory) P_k^-1 a sample of T s. It is summed in blocks of `block` s, of which the last `window` s are
// kept. For a step before block j, the blocks since give
//   theta_j = J_j^-1 b_j,   change_i = ln(theta_ji/theta_0i)
//   V_j = W_j + diag((W_jii/shown_i)^2) + R + diag((R_ii/shown_i)^2) + diag(floor_i^2)
//   W_j = s_j E J_j^-1 E,  R = D P_0 D
//   chi2_j = change' V_j^-1 change,   told: the j of the greatest chi2
//   D = diag(1/theta_0i),  E = diag(1/min(theta_0i, theta_ji)): of what has fallen the logarithm is known less well
// Estimates that still rest on samples from before the step are of neither rig (with two large terms that nearly cancel
// they fall towards zero). So j is sought only where the blocks since agree with one level, j >= j*:
//   j* = argmax of  sum over blocks since j of  (scatter n T_block/memory) + (relative_error)^2 d' J_j d - Q_j,
//   Q_j = sum of (theta_k - theta_j)' J_k (theta_k - theta_j), about n T_block/memory a block if they agree,
//   d = theta_j - theta_0: a model that is a little wrong makes that fraction of a change differ from block to block
// Where they scatter more than n T_block/memory a block, beyond what is allowed for d, their covariance is larger by
// that ratio s_j (Birge, Physical Review 40 (1932)); the one that is told takes in the scatter that is allowed for too.
// `inflation` (of every P_k, F P_k F with F = diag(inflation_i^(1/2))) and `floor` stand for what the estimates'
// covariance does not know: friction that is not viscous, entrained air, noise that is not white and so weighs less
// in one parameter and more in another. `shown` is for motion that hardly shows a parameter: least squares over
// regressors with noise are biased by the inverse square of the excitation, where the scatter has the inverse, so the
// bias goes with the scatter's square and is as large at `shown` (relative); the reference has a bias of its own. A
// parameter that the healthy motion did not show, its reference known to more than a tenth of itself (`kKnown`), is
// left out: y and V are to first order, and of a reference so bad they say nothing. The logarithm makes a factor on a
// parameter a shift of any size; a parameter that changes its sign counts as fallen to `kLeastRatio` of the reference.
// Estimates that are not finite say nothing. Blocks before the first that says anything are not kept: a stage that has
// yet to find its level gives no time over which one was seen.
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

namespace faultline {

struct ParameterChangeOptions {
  double period_s = 0;            // of the estimates
  double memory_s = 0;            // that one estimate rests on, (1 + g)/(1 - g) periods with forgetting g
  double block_s = 0;             // resolution of the time of a step
  double window_s = 0;            // longest time since a step
  double least_s = 0;             // shortest time since a step: what is younger still holds samples from before it
  double scatter = 3;             // times its expected value, that the blocks since a step may scatter
  double relative_error = 0;      // of a change, that may look different from block to block
  std::vector<double> inflation;  // of the estimates' variances, one per parameter
  std::vector<double> shown;      // relative sigma at which a bias is as large, one per parameter
  std::vector<double> floor;      // relative, one per parameter
};

struct ParameterLevel {  // estimate over some time
  Eigen::VectorXd theta;
  Eigen::MatrixXd covariance;
};

struct ParameterStep {
  double chi2 = 0;
  double age = 0;              // s, since the step
  double scatter = 0;          // of the blocks since, Q
  double allowance = 0;        // of Q, for the change itself
  Eigen::VectorXd change;      // ln(theta/reference)
  Eigen::MatrixXd covariance;  // of it
};

class ParameterChange {
 public:
  ParameterChange(int parameters, const ParameterChangeOptions& options);

  void reset();  // forgets all blocks
  // One estimate; `news`: it rests on this sample too. True: a block is complete.
  bool add(const double* theta, const double* covariance, bool news);
  double seconds() const;  // in complete blocks that are kept

  // Over the last `age` s (whole blocks).
  ParameterLevel level(double age) const;
  bool agrees(double age) const;  // whether these blocks agree with one level: Q at most what step_from() allows
  // chi2 0 where there are not blocks enough.
  ParameterStep step_from(const ParameterLevel& reference) const;
  ParameterStep step_from(const ParameterLevel& reference, double age) const;  // over the last `age` s

 private:
  struct Block {
    Eigen::MatrixXd information;
    Eigen::VectorXd weighted;  // information times theta
    double square = 0;         // theta' information theta
  };
  Block nothing() const;
  Block last(std::size_t blocks) const;
  std::size_t blocks_of(double age) const;
  double expected_scatter(std::size_t blocks) const;
  ParameterStep compare(const ParameterLevel& reference, const Block& sum, std::size_t blocks) const;

  int n_;
  ParameterChangeOptions options_;
  std::size_t samples_per_block_, least_blocks_;
  std::vector<Block> ring_;
  std::size_t head_ = 0, filled_ = 0, samples_ = 0;
  Block current_;
  Eigen::VectorXd inflation_;  // of sigma
  Eigen::MatrixXd inflated_, inverse_;
};

}  // namespace faultline
