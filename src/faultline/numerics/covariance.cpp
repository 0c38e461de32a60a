#include "faultline/numerics/covariance.h"

#include "faultline/numerics/padded_product.h"

namespace faultline {

using Index = Eigen::Index;

Covariance::Covariance(const Eigen::Ref<const Eigen::VectorXd>& variances)
    : states_(variances.size()),
      p_(Eigen::MatrixXd::Zero(padded(states_), states_)),
      product_(p_),
      turned_(p_),
      gain_(Eigen::VectorXd::Zero(p_.rows())) {
  p_.diagonal() = variances;
}

void Covariance::propagate(const Eigen::Ref<const Eigen::MatrixXd>& f) {
  multiply_transposed(p_.data(), f.data(), states_, product_.data());  // P F'
  turned_.topRows(states_) = product_.topRows(states_).transpose();    // F P
  multiply_transposed(turned_.data(), f.data(), states_, p_.data());   // F P F'
  // Rounding makes the two halves differ.
  for (Index j = 0; j < states_; ++j)
    for (Index i = 0; i < j; ++i) p_(i, j) = p_(j, i) = 0.5 * (p_(i, j) + p_(j, i));
}

double Covariance::take(const Eigen::Ref<const Eigen::VectorXd>& h) {
  gain_.setZero();
  for (Index s = 0; s < states_; ++s)
    if (h[s] != 0) gain_ += h[s] * p_.col(s);
  const double variance = h.dot(gain_.head(states_)) + 1;
  gain_ /= variance;
  take_square(gain_.data(), variance, states_, p_.data());
  return variance;
}

}  // namespace faultline
