// A ridge: a direction in parameters and sizes along which a recording shows nothing, as of gain, mass and friction of
// an axis whose encoder shows motion alone. Sensitivities are differences that are wrong by a small part; of responses
// that are a million times the noise, which make each other up, that part looks like information and holds the fit
// wherever it came to the ridge. So the response along it is measured by one large step of all of them together:
//
//   J' = J with the column that is most of v replaced by what a step along v does,  J = J' B^-1,  B: 1 but for v
#pragma once

#include <Eigen/Core>

namespace faultline {

struct Ridge {
  Eigen::VectorXd along;      // v; the largest component is about 1
  Eigen::Index replaced = 0;  // the column of J
};

// The direction of which `information` (n x n, J'WJ) says least, each coordinate in units of what it says of it alone.
Ridge weakest(const Eigen::MatrixXd& information);

// [r J]'W[r J] of [r J m]'W[r J m], m: the measured response along the ridge.
Eigen::MatrixXd straightened(const Eigen::MatrixXd& products, const Ridge& ridge);

}  // namespace faultline
