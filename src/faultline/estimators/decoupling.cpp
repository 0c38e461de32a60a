#include "faultline/estimators/decoupling.h"

#include <Eigen/Dense>

namespace faultline {
namespace {

// Rows that span what `columns` does not reach: R columns = 0.
Eigen::MatrixXd left_null_space(const Eigen::MatrixXd& columns) {
  if (columns.cols() == 0) return Eigen::MatrixXd::Identity(columns.rows(), columns.rows());
  const Eigen::FullPivLU<Eigen::MatrixXd> lu(columns.transpose());
  if (lu.dimensionOfKernel() == 0) return Eigen::MatrixXd(0, columns.rows());
  return lu.kernel().transpose();
}

Eigen::Index rank(const Eigen::MatrixXd& matrix) {
  return matrix.size() == 0 ? 0 : Eigen::FullPivLU<Eigen::MatrixXd>(matrix).rank();
}

}  // namespace

Decoupling decouple(const BilinearSystem& system, const std::vector<int>& unknown) {
  const Eigen::Index states = system.a.rows();
  Eigen::MatrixXd e = Eigen::MatrixXd::Zero(states, static_cast<Eigen::Index>(unknown.size()));
  for (std::size_t i = 0; i < unknown.size(); ++i) e(unknown[i], static_cast<Eigen::Index>(i)) = 1;

  Decoupling d;
  d.exists = rank(system.c * e) == rank(e);
  if (!d.exists) return d;
  d.t = left_null_space(e);
  d.w = left_null_space(system.c * e);
  // Of all ways to write x, the one that takes from y only the part along E: measured states stay in w, filtered.
  const Eigen::MatrixXd ce = system.c * e;
  d.n = e.cols() == 0 ? Eigen::MatrixXd::Zero(states, system.c.rows())
                      : Eigen::MatrixXd(e * ce.completeOrthogonalDecomposition().pseudoInverse());
  // x = M w + N y for all x:  M T = I - N C
  d.m = (Eigen::MatrixXd::Identity(states, states) - d.n * system.c) *
        d.t.completeOrthogonalDecomposition().pseudoInverse();
  d.h = d.w * system.c * d.m;
  const double size = system.a.norm();
  for (std::size_t i = 0; i < system.products.size(); ++i) {
    if (system.products[i].size() == 0) continue;
    if ((d.t * system.products[i] * d.m).norm() > 1e-12 * (size + system.products[i].norm()))
      d.varying.push_back(static_cast<int>(i));
  }
  d.strict = d.varying.empty();
  return d;
}

}  // namespace faultline
