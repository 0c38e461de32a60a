// Least squares over the segments of runs with Ceres, and what the minimum knows: Hessian, scatter of the gradient
// over blocks, and how the gradient answers to a change of the model. A parameter's coordinate is the logarithm of
// its ratio to the datasheet's value, in tolerances, p = nominal exp(z tolerance): what is determined as a product or
// a ratio only is then a straight line, along which a linear model of the residuals holds.
//
//   cost(z) = 1/2 sum over segments rho(|r_w|^2) + 1/2 sum k_i z_i^2
//
// The second term is the tolerances' prior. k_i, the weight of parameter i, is how many times the residuals overstate
// what they know of it, 1 where they are white: the scatter of its gradient over blocks of segments to what the
// Hessian says, G_ii B/(B - n)/H_ii; where blocks are few, and at least, the residuals' correlation
// c = 1 + 2 sum of their autocorrelation (up to its first value below 0), mean over the outputs.
//
// Each segment's whitened residuals and sensitivities [J r] are reduced by a QR decomposition to a triangle of
// (parameters + 1) rows: the same norm, the same J'J and J'r, and hours of runs fit in memory.
#pragma once

#include "faultline/fit/fit_options.h"
#include "faultline/segments/linearisation.h"

namespace faultline {

class SegmentSolver {
 public:
  SegmentSolver(const SegmentModel& model, std::vector<SegmentedRun> runs, std::vector<double> noise,
                std::vector<double> scales, const FitOptions& options, int jobs);

  std::size_t segments() const { return segments_; }
  // Root mean square residual per output, in its unit.
  std::vector<double> misfit(const std::vector<double>& values) const;
  // The same of a free run: states are put back at the beginning and after breaks only.
  std::vector<double> free_misfit(const std::vector<double>& values) const;
  // Takes the scatter of each output from the residuals at `values`: a robust mean over segments, never below the
  // noise.
  void set_scatter(const std::vector<double>& values);
  // Start states as the model with these values has them; set_scatter() does that too.
  void place_starts(const std::vector<double>& values);
  bool has_hidden_states() const;
  // Takes c from the residuals at `values`.
  void set_correlation(const std::vector<double>& values);
  double correlation() const { return correlation_; }
  // Takes the weights k of the parameters `free` at `values`, which are near the minimum; all others' are 1.
  void set_weights(const std::vector<double>& values, const std::vector<std::size_t>& free);
  double weight_of(std::size_t parameter) const { return weights_[parameter]; }
  // Moves the parameters `free` of `values` to the minimum. Returns whether it got there within the iterations.
  bool solve(std::vector<double>& values, const std::vector<std::size_t>& free, std::size_t iterations) const;
  // At `values`; the prior is that of the parameters `free`.
  double cost(const std::vector<double>& values, const std::vector<std::size_t>& free) const;
  // Coordinate of a parameter's value and back.
  double coordinate(std::size_t parameter, double value) const;
  double value(std::size_t parameter, double coordinate) const;

  struct Information {
    Eigen::MatrixXd hessian;  // sum of rho' J'J, by central differences
    Eigen::MatrixXd scatter;  // sum over blocks of (sum of rho' J'r)(...)'
    double blocks = 0;
    double values = 0;  // independent residuals: all over c
    double few = 0;     // 0 where there are blocks enough to tell a scatter, 1 where there are none
    // The best estimate of the gradient's covariance at the minimum: by blocks, by correlation, or between.
    Eigen::MatrixXd covariance(double correlation) const;
  };
  Information information(const std::vector<double>& values, const std::vector<std::size_t>& free) const;
  // sum of rho' J'(r_minus - r_plus), one column per change: how the gradient at `values` answers when the truth
  // moves from `minus` to `plus`.
  struct Change {
    ModelChange plus, minus;
  };
  Eigen::MatrixXd responses(const std::vector<double>& values, const std::vector<std::size_t>& free,
                            const std::vector<Change>& changes) const;

 private:
  // Root mean square per output over the segments, of residuals(run) in noise.
  template <class Residuals>
  std::vector<double> over_segments(Residuals&& residuals) const;
  // [J r changes...], whitened, per segment of a run: values x columns. J per scale, by forward differences.
  using Columns = std::vector<Eigen::MatrixXd>;
  Columns columns(const std::vector<double>& values, const std::vector<std::size_t>& free, std::size_t run,
                  const std::vector<Change>& changes, bool central = false) const;
  double segment_values() const;  // readings in a whole segment
  // Triangles of all segments, runs one after the other. Without derivatives: one row with the norm.
  enum class Derivatives { none, forward, central };
  void triangles(const std::vector<double>& values, const std::vector<std::size_t>& free, Derivatives derivatives,
                 Columns& result) const;
  double weight(double square) const;  // rho' of a segment's |r_w|^2

  friend class SegmentCosts;

  const SegmentModel& model_;
  FitOptions options_;
  std::vector<SegmentedRun> runs_;
  std::vector<double> noise_, sigma_, scales_, nominal_;
  int jobs_;
  std::size_t segments_ = 0;
  double correlation_ = 1;
  std::vector<double> weights_;
  std::vector<StartProjection> starts_;  // per run
};

}  // namespace faultline
