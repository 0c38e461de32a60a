// A rig's model as a random process along a recording, linear around what the recording shows of the states: what one
// step of the model misses, and what a signal that nobody knows would do at each port. Grey-box modelling as of
// Kristensen, Madsen and Jorgensen (Automatica 40, 2004); the free signals are latent forces (Alvarez, Luengo,
// Lawrence, IEEE Trans. Pattern Anal. 35, 2013).
//
//   x_i = X_i + S e_i                     X: reference course, S: sizes of the states (diagonal)
//   e_i+1 = F_i e_i + d_i + B_i u_i + w   d_i = S^-1 (f(X_i) - X_i+1), w ~ N(0, Q + C_i), both diagonal
//   y_i = m_i + H_i e_i + D u_i + v       in units of the noise of each output, v ~ N(0, 1)
//
// i counts steps of `stride` samples. f is the model over such a step with all its effects, whose memories go on; F, B
// and H are differences. B: of a free signal (effects/free_signal.cpp) at the port, D: at the sensor of an output.
//
// A state that is shown by a sensor with a memory (a lag, a play) is what the sensor shows; what is behind it is one
// more state, after the rig's; then come those that effects added, as what they are off from rest.
//
// C_i is what no linear model says of a step: dry friction that turns, a valve that opens or not within what is known
// of the states. With the states known to sigma_s it is the second term of a divided difference filter (Norgaard,
// Poulsen, Ravn, Automatica 36, 2000), squared; F is then taken over the same distance:
//
//   C_i = sum over s of [(f(X_i + sigma_s) + f(X_i - sigma_s) - 2 f(X_i)) / 2 S]^2
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "faultline/gap/residual_model.h"

namespace faultline {

// Steps without a break.
struct StochasticStretch {
  std::size_t run = 0;
  std::vector<std::size_t> rows;             // of the recording, one per step and one at the end
  std::vector<Eigen::VectorXd> reference;    // X, per row
  std::vector<Eigen::MatrixXd> f, h;         // per step; per row
  std::vector<Eigen::VectorXd> defect;       // d, per step
  std::vector<Eigen::VectorXd> bend;         // C, per step
  std::vector<char> lost;                    // per step: the model said nothing there; what follows begins anew
  std::vector<Eigen::VectorXd> misfit;       // y - m, per row; NaN: the reading does not count
  std::vector<Eigen::MatrixXd> port_drives;  // per port: states x steps, B; empty where the port moves no state
};

struct StochasticModel {
  double step = 0;                 // s
  std::size_t block = 0;           // steps of one segment
  Eigen::VectorXd size;            // S
  std::vector<std::string> ports;  // that a free signal can enter
  std::vector<int> shows;          // per port: output whose sensor it is, or -1
  std::vector<double> shown;       // ... and what u = 1 is there, in noise of that output: D
  std::vector<double> unit;        // per port: what u = 1 is, in the unit of the free signal's value
  std::vector<StochasticStretch> stretches;
};

// Along `runs` (positions), around the states that these show; without ports. Simulates `jobs` passes at once, as all
// here do.
StochasticModel stochastic_model(const ResidualModel& residuals, const ModelChange& change,
                                 const std::vector<std::size_t>& runs, int jobs);
// The same model around another course, given as shifts e of the reference, per stretch: states x rows. `known`: sigma,
// in sizes.
void move_reference(const ResidualModel& residuals, const ModelChange& change,
                    const std::vector<Eigen::MatrixXd>& shifts, const Eigen::VectorXd& known, int jobs,
                    StochasticModel& model);
// Adds the ports; with a name, that one only.
void open_ports(const ResidualModel& residuals, const ModelChange& change, int jobs, StochasticModel& model,
                const std::string& only = "");
// What passes a port along the reference, as passing() lists it: rows x kMostPassing per stretch. NaN: nothing.
std::vector<Eigen::MatrixXd> passing_along(const ResidualModel& residuals, const ModelChange& change,
                                           const StochasticModel& model, std::size_t port);

}  // namespace faultline
