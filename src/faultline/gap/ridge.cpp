#include "faultline/gap/ridge.h"

#include <Eigen/Eigenvalues>

namespace faultline {

Ridge weakest(const Eigen::MatrixXd& information) {
  const Eigen::VectorXd unit = information.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd alike = unit.asDiagonal() * information * unit.asDiagonal();
  const Eigen::VectorXd least = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(alike).eigenvectors().col(0);
  Ridge ridge;
  least.cwiseAbs().maxCoeff(&ridge.replaced);
  ridge.along = unit.cwiseProduct(least);
  ridge.along /= ridge.along.cwiseAbs().maxCoeff();
  return ridge;
}

Eigen::MatrixXd straightened(const Eigen::MatrixXd& products, const Ridge& ridge) {
  const Eigen::Index n = ridge.along.size(), k = 1 + ridge.replaced;
  Eigen::MatrixXd taken = products.topLeftCorner(1 + n, 1 + n);
  taken.row(k) = products.row(1 + n).head(1 + n);
  taken.col(k) = products.col(1 + n).head(1 + n);
  taken(k, k) = products(1 + n, 1 + n);
  // J' B^-1: of the column that was replaced, (m - the others' part of v)/v_k.
  Eigen::MatrixXd back = Eigen::MatrixXd::Identity(1 + n, 1 + n);
  back.col(k).tail(n) = -ridge.along / ridge.along[ridge.replaced];
  back(k, k) = 1 / ridge.along[ridge.replaced];
  return back.transpose() * taken * back;
}

}  // namespace faultline
