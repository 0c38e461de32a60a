// Decoupling of unknown inputs from a bilinear system, x' = (A + sum u_i A_i) x + B u + E d, y = C x.
// Sources: Yu, Shields, "A bilinear fault detection observer", Automatica 32 (1996); Hou, Muller, "Fault detection and
// isolation observers", International Journal of Control 60 (1994).
//
// T spans all row vectors with T E = 0; w = T x is not acted upon by d. Where
//   (1) rank(C E) = rank(E)
// [T; C] has full column rank, so x = M w + N y, and
//   w' = T (A + sum u_i A_i)(M w + N y) + T B u,    z = W y = H w,   H = W C M,   W C E = 0
// in which only w is not measured; z is what the measurements still say of w. An observer of w,
//   w^' = T (A + sum u_i A_i)(M w^ + N y) + T B u + correction of z - H w^,
// has the error e' = (T A M + sum u_i T A_i M - K H) e, whatever u and d are: nothing but e itself drives it.
//   (2) strict: T A_i M = 0 for every i, the condition of Yu and Shields. The coefficients of the error's equation then
//   do not depend on u
//       either. Else they do, and the correction must hold it stable over the range of those inputs.
//   (3) z has at least one row, and (T A M, H) is detectable: otherwise there is no residual or the observer does not
//   settle.
// Who uses it checks (3), since it depends on the correction (bilinear_observer.cpp).
#pragma once

#include <vector>

#include <Eigen/Core>

#include "faultline/estimators/bilinear_model.h"

namespace faultline {

struct Decoupling {
  Eigen::MatrixXd t, m, n;   // w = T x,  x = M w + N y
  Eigen::MatrixXd w;         // W: rows of y that d does not reach
  Eigen::MatrixXd h;         // z = H w
  bool exists = false;       // (1)
  bool strict = false;       // (2)
  std::vector<int> varying;  // inputs with T A_i M != 0
};

// `unknown`: states whose equations d acts upon, one column of E each.
Decoupling decouple(const BilinearSystem& system, const std::vector<int>& unknown);

}  // namespace faultline
