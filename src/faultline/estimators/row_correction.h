// Kalman correction with one scalar measurement y = h'x + w, w ~ N(0, r), on any square root S of the covariance.
// Source: Potter's update, as in Kaminski, Bryson, Schmidt, IEEE Trans. Automatic Control 16 (1971).
//
//   v = S'h,  s = r + v'v,  K = S v/s,  x += K off,  S -= S v v'/(s + sqrt(r s))
// `off` is y minus what is predicted. S stays real for every r > 0; it need not be triangular and does not stay so.
// Rows with independent noise may be taken one after the other; the sum of off^2/s is the normalised innovation squared
// of all.
#pragma once

#include <cmath>

#include <Eigen/Core>

namespace faultline {

// Both return off^2/s.
template <class Vector, class Root, class Column>
double correct_along(Vector& state, Root& root, const Column& v, double off, double r) {
  const Column sv = root.lazyProduct(v);
  const double s = r + v.squaredNorm();
  state += (off / s) * sv;
  root.noalias() -= (sv * (1 / (s + std::sqrt(r * s)))).lazyProduct(v.transpose());
  return off * off / s;
}

template <class Vector, class Root, class Row>
double correct_row(Vector& state, Root& root, const Row& h, double off, double r) {
  return correct_along(state, root, Vector(root.transpose().lazyProduct(h)), off, r);
}

}  // namespace faultline
