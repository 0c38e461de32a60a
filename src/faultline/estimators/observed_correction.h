// Kalman correction with one measured state, on the lower triangular root S of the covariance: y = x_k + w, w ~ N(0,
// r).
// Source: Carlson, "Fast triangular formulation of the square root filter", AIAA Journal 11 (1973), turned to lower
// triangles.
//
// With v = row k of S, a_j = r + v_j^2 + ... + v_k^2 (a_{k+1} = r) and b_j = v_j s_j + ... + v_k s_k over the columns s
// of S:
//   K = b_0/a_0,   x = x + K (y - x_k),   s_j = sqrt(a_{j+1}/a_j) s_j - v_j/sqrt(a_j a_{j+1}) b_{j+1}
// Rows with independent noise may be taken one after the other; the sum of their (y - x_k)^2/a_0 is the normalised
// innovation squared of all. The root stays triangular and real for every r > 0; r = 0 divides by zero.
#pragma once

#include <cmath>

#include <Eigen/Core>

namespace faultline {

// Returns (y - x_k)^2/a_0.
template <class Vector, class Root>
double correct_observed_state(Vector& state, Root& root, Eigen::Index k, double y, double r) {
  const Eigen::Index n = state.size();
  Vector sum = Vector::Zero(n);
  double above = r, root_above = std::sqrt(r);
  for (Eigen::Index j = k; j >= 0; --j) {
    const double v = root(k, j);
    if (v == 0) continue;
    const double total = above + v * v;
    const double root_total = std::sqrt(total);
    const double shrink = root_above / root_total;
    const double take = v / (root_total * root_above);
    for (Eigen::Index i = j; i < n; ++i) {
      const double s = root(i, j);
      root(i, j) = shrink * s - take * sum[i];
      sum[i] += v * s;
    }
    above = total;
    root_above = root_total;
  }
  const double off = y - state[k];
  state += (off / above) * sum;
  return off * off / above;
}

}  // namespace faultline
