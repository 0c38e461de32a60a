// A driven model's residuals and their sensitivities around one set of parameters, computed once and shared by all candidates.
//
//   L(z) = 1/2 sum over segments of w r' W r + 1/2 |z|^2          z: deviation of each free parameter in tolerances
//
// W projects the start states out (residual_model.h). The weights w weaken segments where the model cannot reach the noise, so that
// a wrong structure does not drag parameters off for ever.
#pragma once

#include <Eigen/Core>

#include "faultline/gap/residual_model.h"

namespace faultline {

// What is computed once around a model and shared by all candidates: residuals, their sensitivity to parameters and start states.
class Linearisation {
 public:
  // `runs`: which of the residual model's. Uses `jobs` threads. `starts`: sensitivities to start states where they are known already,
  // per run.
  Linearisation(const ResidualModel& residuals, const GapModel& model, std::vector<std::size_t> runs, int jobs,
                std::vector<std::vector<Eigen::MatrixXf>> starts = {});

  // The sensitivities of `near` around a model that has hardly moved from there: only residuals and shifts of start states are new.
  Linearisation(const ResidualModel& residuals, const GapModel& model, const Linearisation& near);

  // Loss r' W r / 2 of residuals r (one matrix per run) with the start states projected out, per segment.
  std::vector<double> segment_losses(const std::vector<Eigen::MatrixXf>& residuals) const;
  // The weight of each segment in fits: one over its mean squared residual at the model, at most 1, so that a few segments in
  // which the model goes astray (a breakaway a moment too late) do not outweigh all others.
  double weight(std::size_t segment) const { return weights_[segment]; }
  // Gram matrix of columns (each: one matrix per run) under W and the weights. The first column may be residuals, to which the
  // prior of the start states belongs; all others are sensitivities. `gradients`, if given, takes each segment's part of the products of
  // the first column with the others.
  Eigen::MatrixXd gram(const std::vector<const std::vector<Eigen::MatrixXf>*>& columns, bool residuals_first,
                       std::vector<Eigen::VectorXd>* gradients = nullptr) const;

  const std::vector<Eigen::MatrixXf>& at_model() const { return at_model_; }
  const std::vector<std::vector<Eigen::MatrixXf>>& parameter_columns() const { return columns_; }  // d r / d z
  const std::vector<Eigen::MatrixXf>& start_columns(std::size_t run) const { return starts_[run]; }
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
  std::vector<Eigen::MatrixXd> shifts_;                // per run: segments x shown states
  std::vector<std::vector<Eigen::MatrixXd>> inverse_;  // per run and segment: (S'S + I)^-1
  std::vector<std::vector<Eigen::MatrixXd>> cross_;    // per run and segment: S'J
  Eigen::MatrixXd parameter_gram_;
  std::vector<double> weights_;  // per segment, runs one after the other
};

// Loss with the parameters adjusted to first order, for residuals of a changed model at the linearisation's parameters.
double projected_loss(const Linearisation& linear, const std::vector<Eigen::MatrixXf>& residuals,
                      const Eigen::VectorXd& z);

// Normalised residuals of some of the runs, and (a - b)/step of two such.
std::vector<Eigen::MatrixXf> residuals_of(const ResidualModel& model, const GapModel& at,
                                          const std::vector<std::size_t>& runs);
std::vector<Eigen::MatrixXf> difference(const std::vector<Eigen::MatrixXf>& a, const std::vector<Eigen::MatrixXf>& b,
                                        double step);

// Deviation of each free parameter in tolerances.
Eigen::VectorXd deviations(const Datasheet& sheet, const std::vector<std::size_t>& free,
                           const std::vector<double>& parameters);

}  // namespace faultline
