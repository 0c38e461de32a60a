// What a free signal at each port would win in likelihood (free_signal_filter.h), for all ports from one filter pass
// and one backward pass: the gains of a Kalman filter do not depend on where a signal enters.
//
//   e_i+1 = L_i e_i + b_i u_i        error of the prediction that a signal u makes; L_i = F_i (I - P_i J_i), J = H'H
//   r_i = H'S^-1 v_i + L_i' r_i+1    what all later innovations v say of an error at row i (disturbance smoother;
//   N_i = M_i + L_i' N_i+1 L_i       de Jong, Biometrika 76, 1989), and its information; M = H'S^-1 H
//
// With u constant over bumps of a tenth of a block, A and b of  log likelihood = b'u - u'A u / 2  follow from N and r
// with products of a matrix and a vector only. The Ornstein-Uhlenbeck prior of the bumps has a precision K of three
// diagonals. With  L L' = A + K,  the bump k takes (L^-1 b)_k^2 off the squared innovations of the blocks that show it,
// and what the signal wins is
//
//   1/2 sum over blocks of n log(mean square before/after) - 1/2 log |A + K| + 1/2 log |K|
//
// for any level and memory, at the cost of factoring a band. Bumps further apart than a chunk count as unrelated, and
// A is tapered towards that distance, so that it stays positive.
#pragma once

#include <vector>

#include "faultline/gap/free_signal_filter.h"

namespace faultline {

struct ScannedSignal {
  FreeSignal signal;  // the likeliest level and memory; level 0: none wins anything
  double gain = 0;    // log likelihood
};

// Per port of the model. `q`: as of block_losses().
std::vector<ScannedSignal> scan_signals(const StochasticModel& model, const Eigen::VectorXd& q, int jobs);

}  // namespace faultline
