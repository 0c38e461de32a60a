// Nonlinear least squares with bounds, by Ceres: Levenberg and Marquardt on the normal equations.
//
//   cost(z) = 1/2 sum over blocks rho(|r_b(z)|^2) + 1/2 sum k_i z_i^2
//
// rho is Huber's loss. Ceres and the libraries that it stands on take longer to load than most recordings to diagnose,
// so all that knows it is a library of its own, which is loaded with the first problem (late_library.h).
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include <Eigen/Core>

namespace faultline {

struct LeastSquares {
  std::size_t blocks = 0;
  // Of every block the triangle of [J r], (parameters + 1) rows; without derivatives |r| at its last place.
  std::function<void(const std::vector<double>& z, bool derivatives, std::vector<Eigen::MatrixXd>& triangles)>
      triangles;
  double huber = 0;             // of |r_b|
  std::vector<double> weights;  // k
  std::vector<double> lowest, highest;
  int iterations = 0;                             // at most
  double cost_tolerance = 0, step_tolerance = 0;  // relative, at which it has converged
};

// Moves z to the minimum. Whether it got there within the iterations.
bool minimise(const LeastSquares& problem, std::vector<double>& z);

}  // namespace faultline
