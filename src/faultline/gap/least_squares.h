// Fits parameters and effects of a driven model to runs, by Gauss-Newton steps on the residual model's loss:
//
//   L(z) = 1/2 sum over segments of w r' W r + 1/2 |z_parameters|^2
//
// z: each parameter's deviation in tolerances (prior: one standard normal each, bound at 3.5), then each effect parameter in a
// coordinate that runs evenly over its range (logarithmic where the range spans decades). W projects the start states out. The
// weights w weaken segments where the model cannot reach the noise, so that a wrong structure does not drag parameters off for ever.
#pragma once

#include <functional>

#include <Eigen/Core>

#include "faultline/gap/residual_model.h"

namespace faultline {

// An effect at a port with the range of each of its parameters.
struct Candidate {
  EffectSpec effect;  // parameters filled while fitting
  std::string family;
  std::vector<Bounds> bounds;  // per parameter of the type
  bool logarithmic(std::size_t parameter) const;
  double to_coordinate(std::size_t parameter, double value) const;  // 0..1 over the bounds
  double from_coordinate(std::size_t parameter, double coordinate) const;
};

// Every effect at every fitting port of the datasheet, but for those in `without` ("effect" or "effect@port"). `duration`: s, of the
// longest run: where an unbounded time may lie.
std::vector<Candidate> candidates(const Datasheet& sheet, const std::vector<std::string>& without,
                                  double duration = 60);

// Starting points over a candidate's range: few for the size, few for a shape.
std::vector<std::vector<double>> starting_points(const Candidate& candidate);

// What is computed once around a model and shared by all candidates: residuals, their sensitivity to parameters and start states.
class Linearisation {
 public:
  // `runs`: which of the residual model's. Uses `jobs` threads.
  Linearisation(const ResidualModel& residuals, const GapModel& model, std::vector<std::size_t> runs, int jobs);

  // Loss r' W r / 2 of residuals r (one matrix per run) with the start states projected out, per segment.
  std::vector<double> segment_losses(const std::vector<Eigen::MatrixXf>& residuals) const;
  // The weight of each segment in fits: one over its mean squared residual at the model, at most 1, so that a few segments in
  // which the model goes astray (a breakaway a moment too late) do not outweigh all others.
  double weight(std::size_t segment) const { return weights_[segment]; }
  // Gram matrix of columns (each: one matrix per run) under W and the weights.
  Eigen::MatrixXd gram(const std::vector<const std::vector<Eigen::MatrixXf>*>& columns) const;

  const std::vector<Eigen::MatrixXf>& at_model() const { return at_model_; }
  const std::vector<std::vector<Eigen::MatrixXf>>& parameter_columns() const { return columns_; }  // d r / d z
  const std::vector<std::size_t>& free_parameters() const { return free_; }
  const std::vector<std::size_t>& runs() const { return runs_; }
  double values() const;  // number of residuals that count (whole segments)
  // The same for some of the runs only (positions in runs()).
  Linearisation subset(const std::vector<std::size_t>& positions) const;
  // r' W r and r' W J for residuals r; J' W J.
  double square(const std::vector<Eigen::MatrixXf>& residuals, Eigen::VectorXd& against_parameters) const;
  const Eigen::MatrixXd& parameter_gram() const { return parameter_gram_; }

 private:
  explicit Linearisation(const ResidualModel& residuals) : residuals_(residuals) {}
  void prepare();

  const ResidualModel& residuals_;
  std::vector<std::size_t> runs_;
  std::vector<std::size_t> free_;
  std::vector<Eigen::MatrixXf> at_model_;
  std::vector<std::vector<Eigen::MatrixXf>> columns_;
  std::vector<std::vector<Eigen::MatrixXf>> starts_;   // per run, per shown state
  std::vector<std::vector<Eigen::MatrixXd>> inverse_;  // per run and segment: (S'S + I)^-1
  std::vector<std::vector<Eigen::MatrixXd>> cross_;    // per run and segment: S'J
  Eigen::MatrixXd parameter_gram_;
  std::vector<double> weights_;  // per segment, runs one after the other
};

struct FitResult {
  GapModel model;
  double loss = 0;  // L(z)
  std::vector<Candidate> effects;
  Eigen::MatrixXd covariance;  // of the effects' coordinates, after parameters
};

// Runs `work(i)` for i in 0..count-1 on `jobs` threads; results do not depend on the order. The first exception ends it all and is
// thrown on.
void parallel(std::size_t count, int jobs, const std::function<void(std::size_t)>& work);

// Refits the free parameters and the effects' parameters from where `start` and `effects` have them, in at most `iterations`
// Gauss-Newton steps. Sensitivities to parameters are those of `linear`; those to effects are found anew in each step.
FitResult fit_gap(const ResidualModel& residuals, const GapModel& start, const std::vector<Candidate>& effects,
                  const Linearisation& linear, int iterations);

// Loss with the parameters adjusted to first order, for residuals of a changed model at the linearisation's parameters.
double projected_loss(const Linearisation& linear, const std::vector<Eigen::MatrixXf>& residuals,
                      const Eigen::VectorXd& z);

// Deviation of each free parameter in tolerances.
Eigen::VectorXd deviations(const Datasheet& sheet, const std::vector<std::size_t>& free,
                           const std::vector<double>& parameters);

}  // namespace faultline
