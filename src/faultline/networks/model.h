// A trained network: shape, scaling, weights and how far it was off. Kept as a stage's reference (rig/reference.h):
// text, with the rig's name, a version and a check sum; the names beside the numbers tell every signal and weight, so
// that a file of another rig, network or sample period is refused.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "faultline/networks/shape.h"
#include "faultline/networks/signals.h"
#include "faultline/rig/reference.h"

namespace faultline {

struct NetworkModel {
  NetworkShape shape;
  Scaling inputs, outputs;
  std::vector<double> rms;           // of each output's error when it was trained, in the channel's unit
  Feedback trained = Feedback::all;  // what was fed back then
  Eigen::VectorXd weights;           // of scaled signals
};

Reference to_reference(const NetworkModel& model);
// InputError unless it is of this shape; what is fed back may differ.
NetworkModel to_model(const NetworkShape& shape, const Reference& reference);

// The network `stage` of a file. `rig`, for which it must have been trained. InputErrors begin with the file.
NetworkModel read_network(const std::string& file, const std::string& rig, const std::string& stage,
                          const NetworkShape& shape);

}  // namespace faultline
