// Training's sums for networks into which nothing is fed back and that have no linear neuron (NARX): what training.h
// says, hundreds of samples at a time.
//
// Every output's derivative by a first layer's weight (i, a) is W2_oi s_i z_a, s = 1 - h^2, z with a 1 for the bias. So
// J'J needs the sums of (s_i s_j)(z_a z_b) alone: one for all outputs, and no pair (i, j) or (a, b) twice, which is a
// quarter to an eighth of the products of J's rows.
#pragma once

#include "faultline/networks/training.h"

namespace faultline {

bool is_one_step(const NetworkShape& shape);
// As mean_squares() and normal_equations(), of a network that is one step.
Eigen::VectorXd one_step_mean_squares(const NetworkShape& shape, const Eigen::VectorXd& weights,
                                      const std::vector<NetworkRun>& runs);
NormalEquations one_step_equations(const NetworkShape& shape, const Eigen::VectorXd& weights,
                                   const std::vector<NetworkRun>& runs);

}  // namespace faultline
