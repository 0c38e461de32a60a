// Training by Levenberg-Marquardt: the weights that make the sum of squared errors over all samples least.
//
//   (J' J / n + damping D) d = J' e / n,   w + d where that lowers the error, else ten times the damping;
//   D = diag(J' J / n) and a little more
// Source: Hagan, Menhaj, Training feedforward networks with the Marquardt algorithm, IEEE Transactions on Neural
// Networks 5 (1994). J by forward sensitivities (network.h): exact, for recurrent networks too. J' J is added up a
// block of samples at a time, so that memory does not grow with their number; without feedback between units its
// blocks are theirs alone.
//
// Signals scaled to about 1. The run's first sample is where outputs that are fed back begin. All numbers follow from
// weights, runs and seed: the same on every run of one program.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "faultline/networks/network.h"
#include "faultline/networks/signals.h"

namespace faultline {

// Random weights: rows of W1 with variance 1/entries, so that no neuron begins saturated; W2 small.
Eigen::VectorXd initial_weights(const NetworkShape& shape, std::uint64_t seed);

// Where outputs that are fed back begin. A recurrent network that is far off learns little from whole runs, on which it
// runs away or in circles: a short horizon, then a longer one, lead it there. One that begins from what is measured
// learns to remember it, where that explains what its inputs do not (oil that warms during every run); a cold start
// leaves it nothing to remember.
struct Beginnings {
  std::size_t horizon = 0;  // samples after which they begin anew; 0: never
  std::size_t cold = 0;     // 0: from what is measured; else from the mean (0), and so many samples are not counted
};

// Mean square of each output's error; infinite where the network runs away.
Eigen::VectorXd mean_squares(const NetworkShape& shape, const Eigen::VectorXd& weights,
                             const std::vector<NetworkRun>& runs, const Beginnings& beginnings = {});

struct NormalEquations {
  Eigen::MatrixXd square;    // J' J / n, lower triangle
  Eigen::VectorXd gradient;  // J' e / n
  double error = 0;          // e' e / n: n samples, all outputs; infinite where anything is not finite
};
NormalEquations normal_equations(const NetworkShape& shape, const Eigen::VectorXd& weights,
                                 const std::vector<NetworkRun>& runs, const Beginnings& beginnings = {});

// All that training goes on from.
struct TrainingState {
  Eigen::VectorXd weights;
  double error = 0;  // of the training runs
  double damping = 1e-3;
  int epoch = 0;
  Eigen::VectorXd best;   // weights with the least error of the validation runs, or else of the training runs
  double best_error = 0;  // that error
  int best_epoch = 0;
};

class Trainer {
 public:
  // Scaled runs; `validation` may be empty, and is judged over whole runs.
  Trainer(NetworkShape shape, std::vector<NetworkRun> training, std::vector<NetworkRun> validation,
          const Beginnings& beginnings = {});

  // InputError where the network runs away with these weights.
  TrainingState begin(const Eigen::VectorXd& weights) const;
  // One step that lowers the error of the training runs; false if there is none any more, and nothing has changed.
  bool epoch(TrainingState& state) const;

  const NetworkShape& shape() const { return shape_; }
  const std::vector<NetworkRun>& judged() const { return validation_.empty() ? training_ : validation_; }
  double samples() const;

 private:
  NetworkShape shape_;
  std::vector<NetworkRun> training_, validation_;
  Beginnings beginnings_, whole_;
};

}  // namespace faultline
