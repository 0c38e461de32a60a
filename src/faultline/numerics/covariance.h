// Covariance P of a Kalman filter, for any number of states.
//
//   propagate:  P <- F P F'
//   take:       S = h' P h + 1,  g = P h / S,  P <- P - S g g'       a reading h'x + noise of variance 1
//
// P is written as a whole, not its half, so that all loops run along memory (padded_product.h). Nothing is allocated
// after the constructor.
#pragma once

#include <Eigen/Core>

namespace faultline {

class Covariance {
 public:
  // P at first: diagonal.
  explicit Covariance(const Eigen::Ref<const Eigen::VectorXd>& variances);

  void propagate(const Eigen::Ref<const Eigen::MatrixXd>& f);
  // Returns S; the gain g is in gain() until the next call.
  double take(const Eigen::Ref<const Eigen::VectorXd>& h);

  auto gain() const { return gain_.head(states_); }
  auto matrix() const { return p_.topRows(states_); }
  // What noise adds to each state's variance.
  auto variances() { return p_.diagonal(); }

 private:
  Eigen::Index states_;
  Eigen::MatrixXd p_, product_, turned_;  // rows: states_, then zeros
  Eigen::VectorXd gain_;
};

}  // namespace faultline
