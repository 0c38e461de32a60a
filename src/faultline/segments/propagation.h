// A rig's model from one sample to the next, as a map of the states that the datasheet lists, and its derivatives by
// differences: what time scales and the smoother of unmeasured states rest on.
//
//   x_k+1 = f(x_k, u_k),  y_k = h(x_k);   F = df/dx, H = dh/dx
//
// A state that a channel shows counts as that channel shows it, through its sensor's effects. States of effects (a
// second body, a hose) begin at rest in every step. y: compared_outputs().
#pragma once

#include "faultline/segments/segment_model.h"

namespace faultline {

struct Step {
  Eigen::VectorXd next;     // x_k+1
  Eigen::VectorXd outputs;  // y_k
};

class Propagation {
 public:
  // `period`: s, of the recordings.
  Propagation(const Datasheet& sheet, const ModelChange& change, double period);

  // From a state at a row that is not the last, with the commands and inputs there.
  Step step(const Recording& recording, std::size_t row, const Eigen::VectorXd& state);
  // F and H there; `size`: of the differences, per state.
  void jacobians(const Recording& recording, std::size_t row, const Eigen::VectorXd& state, const Eigen::VectorXd& size,
                 Eigen::MatrixXd& f, Eigen::MatrixXd& h);
  // What the rig starts from at a row by itself.
  Eigen::VectorXd own_start(const Recording& recording, std::size_t row);

 private:
  DrivenModel model_;
  std::vector<int> outputs_;
  std::vector<int> shown_by_;  // per state: channel, or -1
};

// Steps of differences by each state: a small part of what it goes through, or of its channel's range. `size`: largest
// magnitude of each.
Eigen::VectorXd difference_steps(const Datasheet& sheet, const Eigen::VectorXd& size);

}  // namespace faultline
