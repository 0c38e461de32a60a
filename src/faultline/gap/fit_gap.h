// Fits parameters and effects of a driven model to runs, by damped Gauss-Newton steps on
//
//   L(z, c) = sum over segments of n/2 log(r' W r / n) + 1/2 |z|^2 + 1/2 |c - start|^2
//
// z: deviation of each parameter in tolerances, within its bound; c: each effect parameter's coordinate
// (candidates.h), known beforehand to about its range. W, n: linearisation.h.
#pragma once

#include "faultline/attribution/candidates.h"
#include "faultline/gap/linearisation.h"

namespace faultline {

struct FitResult {
  ModelChange model;
  double loss = 0;  // L(z, c)
  std::vector<Candidate> effects;
  Eigen::MatrixXd
      covariance;  // of parameters in tolerances, then of the effects' coordinates; empty before uncertainty()
};

// Refits the effects' parameters, and where they move the free parameters, from where `start` and `effects` have them,
// in at most `iterations` steps. Sensitivities to parameters are those of `linear`; those to effects are found anew in
// each step. Simulates `jobs` runs at once, as all here do.
FitResult fit_gap(const ResidualModel& residuals, const ModelChange& start, const std::vector<Candidate>& effects,
                  const Linearisation& linear, std::size_t iterations, int jobs = 1, bool parameters_move = true);

// Of the response to each size the part that parameters and the other sizes do not make up for, the least; 1 without
// any.
double least_own_part(const ResidualModel& residuals, const FitResult& fit, const Linearisation& linear, int jobs);

// Moves the free parameters by so many tolerances, within their bound.
void shift_parameters(const ResidualModel& residuals, const std::vector<std::size_t>& free, const Eigen::VectorXd& move,
                      std::vector<double>& parameters);

// Information (d r/d c)' W (d r/d c) of each run, in the order of linear.runs(), about each of the effects'
// coordinates that have a range.
std::vector<Eigen::VectorXd> information(const ResidualModel& residuals, const FitResult& fit,
                                         const Linearisation& linear, int jobs = 1);

// Covariance at a fit, robust against residuals that are not white and models that are not exact (Huber's sandwich,
// by segments): H^-1 (sum over segments of g g') H^-1 + H^-1 for what only the prior holds. `linear` must stand at
// the fit.
Eigen::MatrixXd uncertainty(const ResidualModel& residuals, const FitResult& fit, const Linearisation& linear,
                            int jobs = 1);

// The model with these effects and parameters.
ModelChange with_effects(const std::vector<Candidate>& effects, const std::vector<double>& parameters);

}  // namespace faultline
