// Errors in variables: what the noise of measured inputs gives to an effect that is not there.
//
// A model that is driven by readings turns their noise into outputs that the rig never had, and an effect that makes it
// softer or slower makes less of them: it lowers the residuals of a rig that has nothing of the kind. How much it wins
// by that is seen on a rig that is the model itself, driven by u, whose readings of u have their noise once more:
//
//   r(m) = y(m, u + n) - y(plain, u) + e        win = loss(r(plain)) - loss(r(with the effect))
//
// n: white, of the readings' own noise, smoothed as they were; e: white, in each segment as large as what the model
// with the effect leaves of each output there. Losses are logarithms: with another e an effect that the rig has would
// not lose here what it wins there. What an effect does by itself counts against it, so that it wins nothing (the win
// is negative).
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "faultline/gap/residual_model.h"

namespace faultline {

// Whether a run has inputs that are measured, and not exactly.
bool has_noisy_inputs(const std::vector<SegmentedRun>& runs);

// The same runs with n on their inputs. Starts stay.
ResidualModel with_input_noise(const ResidualModel& residuals, std::uint64_t seed);

// r(m) of `noisy`, which is with_input_noise() of m's residuals; `plain`: normalised residuals of the model without the
// effect over the same runs as they are; `left`: those of the model with it.
std::vector<Eigen::MatrixXf> placebo_residuals(const ResidualModel& noisy, const ModelChange& model,
                                               const std::vector<std::size_t>& runs,
                                               const std::vector<Eigen::MatrixXf>& plain,
                                               const std::vector<Eigen::MatrixXf>& left, std::uint64_t seed, int jobs);

}  // namespace faultline
