// The screening with which every "which effect explains this" begins: what a model leaves, to first order in its
// parameters and in the size of each hypothesis. Sources: Gustafsson, Adaptive Filtering and Change Detection (2000),
// chapter 9 (likelihood ratio with sizes and parameters marginalised).
//
//   L(theta, a) = sum over segments of weight |r + T theta + D a|^2 + |z + theta|^2
//   G = sum over segments of weight [r T D]'[r T D],  and [z 1 0]'[z 1 0] for what is known beforehand
//
// r: whitened residuals (segments/linearisation.h); T: their derivatives by the parameters in tolerances, z: how far
// these are off; D: what each hypothesis changes, per amplitude or from none to a trial size. With theta at its best
//
//   min over theta of L = [1 a'] S [1 a']',  S = G_aa - G_at G_tt^-1 G_ta       G_aa: of [r D]
//
// so hypothesis h alone is best at a = -S_rh/S_hh, with standard error S_hh^(-1/2), and wins S_rh^2/S_hh. Weights that
// follow from what is left (gap/linearisation.h) make this a step of several. Sizes far from the linear part are tried
// by running the model (try_sizes).
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include <Eigen/Core>

namespace faultline {

// G of what is known of parameters beforehand: to one tolerance, `z` off.
Eigen::MatrixXd known_to_tolerance(const Eigen::VectorXd& z);
// S of a G with `parameters` of them.
Eigen::MatrixXd without_parameters(const Eigen::MatrixXd& gram, Eigen::Index parameters);
// The theta of the least L without any hypothesis, and that L.
Eigen::VectorXd best_parameters(const Eigen::MatrixXd& gram, Eigen::Index parameters);
double least_loss(const Eigen::MatrixXd& gram, Eigen::Index parameters);

struct BestSize {
  double size = 0;
  double information = 0;  // S_hh
  double gain = 0;         // L(0) - L(size)
};
// Of the hypothesis in row `h` >= 1 of S, within its range. Nothing where the information is `least` or less.
BestSize best_size(const Eigen::MatrixXd& left, Eigen::Index h, double lowest, double highest, double least = 0);

struct Trial {
  std::size_t hypothesis;  // trials of one stand side by side
  bool first;              // tried before those that are not
  double loss = 0;         // infinite until it is tried; also where it lies above what was enough
};

// Runs trials and returns the best of each hypothesis, best first. loss(trial, enough) may be anything above `enough`
// where it is more. First trials say how good the others must be: hypotheses that come behind the best `followed` of
// these are not tried further, and one that has none is left out unless it does better. `jobs` hypotheses at once.
std::vector<std::size_t> try_sizes(std::vector<Trial>& trials, std::size_t followed, int jobs,
                                   const std::function<double(std::size_t trial, double enough)>& loss);

}  // namespace faultline
