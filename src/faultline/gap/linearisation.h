// A driven model's residuals and their sensitivities around one set of parameters, computed once and shared by all
// candidates.
//
//   L(z) = sum over segments of n/2 log(r' W r / n) + 1/2 |z|^2      z: deviation of each free parameter in tolerances
//
// W projects the start states out (segments/linearisation.h). Each of a segment's n values has that segment's own noise
// level, whose best value is put in: near the recording's noise a segment counts as 1/2 r' W r does, but one in which
// the model goes astray (a breakaway a moment too late) does not outweigh all others, and a wrong structure does not
// drag parameters off for ever. Minimised by weights: each step takes 1/2 w r' W r with w = n / r' W r.
#pragma once

#include <memory>

#include <Eigen/Core>

#include "faultline/gap/residual_model.h"
#include "faultline/segments/linearisation.h"

namespace faultline {

// Loss of a segment of n values with its own noise level, from 1/2 r' W r; its variance is not taken below `least`
// noise variances (GapOptions::Linearisation::least_variance_fraction).
double robust(double loss, double values, double least);
// d robust / d loss.
double robust_weight(double loss, double values, double least);

// How derivatives are taken. Central ones cost twice as much. Along a ridge, on which parameters and sizes trade with
// one another, what forward ones are wrong by is taken for information.
enum class Differences { forward, central };

// What is computed once around a model and shared by all candidates: residuals, their sensitivity to parameters and
// start states (segments/linearisation.h).
class Linearisation {
 public:
  // `runs`: which of the residual model's. Uses `jobs` threads. `starts`: sensitivities to start states where they
  // are known already, per run.
  Linearisation(const ResidualModel& residuals, const ModelChange& model, std::vector<std::size_t> runs, int jobs,
                std::vector<std::vector<Eigen::MatrixXf>> starts = {}, Differences differences = Differences::forward);

  // The sensitivities of `near` around a model that has hardly moved from there: only residuals and shifts of start
  // states are new.
  Linearisation(const ResidualModel& residuals, const ModelChange& model, const Linearisation& near, int jobs);

  // Loss r' W r / 2 of residuals r (one matrix per run) with the start states projected out, per segment.
  std::vector<double> segment_losses(const std::vector<Eigen::MatrixXf>& residuals) const;
  // The weight of each segment at the model.
  const std::vector<double>& weights() const { return weights_; }
  // Under W, of each segment: [r T C]'[r T C] of residuals, their sensitivities to the parameters and those of
  // `columns` (each: one matrix per run).
  using Columns = std::vector<std::vector<Eigen::MatrixXf>>;
  std::vector<Eigen::MatrixXd> products(const std::vector<Eigen::MatrixXf>& residuals,
                                        const Columns& columns = {}) const;

  const std::vector<Eigen::MatrixXf>& at_model() const { return at_model_; }
  const std::vector<Eigen::MatrixXf>& start_columns(std::size_t run) const { return around_[run]->starts.columns(); }
  const Datasheet& sheet() const { return residuals_.sheet(); }
  const std::vector<std::size_t>& free_parameters() const { return free_; }
  const std::vector<std::size_t>& runs() const { return runs_; }
  // The same for some of the runs only (positions in runs()).
  Linearisation subset(const std::vector<std::size_t>& positions) const;
  double segment_values() const { return residuals_.segment_values(); }  // residuals in a segment
  double robust(double loss) const;                                      // of one of its segments
  double robust_weight(double loss) const;
  const GapOptions& options() const { return residuals_.options(); }
  Differences differences() const { return differences_; }

 private:
  // Sensitivities of a run.
  struct Around {
    StartProjection starts;
    std::vector<Eigen::MatrixXf> parameters;  // per segment: values x free parameters, whitened
    std::vector<Eigen::MatrixXd> grams;       // per segment
  };

  explicit Linearisation(const ResidualModel& residuals) : residuals_(residuals) {}
  void take_weights();
  // visit(run's place, segment, sensitivities) for each segment, runs one after the other.
  template <class Visit>
  void for_each_segment(Visit&& visit) const;

  const ResidualModel& residuals_;
  Differences differences_ = Differences::forward;
  std::vector<std::size_t> runs_;
  std::vector<std::size_t> free_;
  std::vector<Eigen::MatrixXf> at_model_;
  std::vector<std::shared_ptr<const Around>> around_;  // per run
  std::vector<double> weights_;                        // per segment, runs one after the other
};

// Minimum of 1/2 move' hessian move + gradient' move with z + the first z.size() moves within the parameters' bound
// (`lowest` on the low side); where that takes more steps than the options allow, one that is not uphill.
Eigen::VectorXd bounded_move(const Eigen::MatrixXd& hessian, const Eigen::VectorXd& gradient, const Eigen::VectorXd& z,
                             const Eigen::VectorXd& lowest, const GapOptions::Linearisation& options);

// L with the parameters, z at the linearisation, adjusted to first order within their bound. Where products have a
// column C, residuals are r + fraction C, and the fraction, from `fraction` on, is adjusted within its range as well.
struct Adjusted {
  double loss = 0;
  Eigen::VectorXd move;
  double fraction = 0;
};
Adjusted adjusted(const Linearisation& linear, const std::vector<Eigen::MatrixXd>& products, const Eigen::VectorXd& z,
                  double fraction = 0);

// Normalised residuals of some of the runs (`jobs` at once), and (a - b)/step of two such.
std::vector<Eigen::MatrixXf> residuals_of(const ResidualModel& model, const ModelChange& at,
                                          const std::vector<std::size_t>& runs, int jobs = 1);
std::vector<Eigen::MatrixXf> difference(const std::vector<Eigen::MatrixXf>& a, const std::vector<Eigen::MatrixXf>& b,
                                        double step);

// Deviation of each free parameter in tolerances, and the lowest that it may have (parameter_range.h).
Eigen::VectorXd deviations(const Datasheet& sheet, const std::vector<std::size_t>& free,
                           const std::vector<double>& parameters);
Eigen::VectorXd lowest_deviations(const Datasheet& sheet, const std::vector<std::size_t>& free,
                                  const GapOptions::Linearisation& options);

}  // namespace faultline
