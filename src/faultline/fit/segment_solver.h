// Least squares over the segments of runs with Ceres, and what the minimum knows: Hessian, scatter of the gradient
// over blocks, and how the gradient answers to a change of the model. Parameters are counted in their scales
// (tolerances) around the datasheet's value.
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
  // Takes the scatter of each output from the residuals at `values`: a robust mean over segments, never below the
  // noise.
  void set_scatter(const std::vector<double>& values);
  // Moves the parameters `free` of `values` to the minimum.
  void solve(std::vector<double>& values, const std::vector<std::size_t>& free, std::size_t iterations) const;

  struct Information {
    Eigen::MatrixXd hessian;  // sum of rho' J'J
    Eigen::MatrixXd scatter;  // sum over blocks of (sum of rho' J'r)(...)'
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
  // [J r changes...], whitened, per segment of a run: values x columns. J per scale, by forward differences.
  using Columns = std::vector<Eigen::MatrixXd>;
  Columns columns(const std::vector<double>& values, const std::vector<std::size_t>& free, std::size_t run,
                  const std::vector<Change>& changes) const;
  double segment_values() const;  // readings in a whole segment
  void prepare_starts(const std::vector<double>& values);
  // Triangles of all segments, runs one after the other. Without derivatives: one row with the norm.
  void triangles(const std::vector<double>& values, const std::vector<std::size_t>& free, bool derivatives,
                 Columns& result) const;
  double weight(double square) const;  // rho' of a segment's |r_w|^2

  friend class SegmentCosts;

  const SegmentModel& model_;
  FitOptions options_;
  std::vector<SegmentedRun> runs_;
  std::vector<double> noise_, sigma_, scales_, nominal_;
  int jobs_;
  std::size_t segments_ = 0;
  std::vector<StartProjection> starts_;  // per run
};

}  // namespace faultline
