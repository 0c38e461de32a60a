// The segments of a run to first order around a model, with their start states projected out: what fits, gaps and
// fault responses are made from.
//
//   r(x, d) = r + J x + S d,   d ~ N(0, 1)          J: d r/d directions, S: d r/d start, segment_model.h
//   w = (I + S S')^(-1/2) (r - S d_0),   W = (I + S S')^(-1/2) J
//   |w + W x|^2 = min over d of  |r + J x + S (d - d_0)|^2 + |d|^2
//
// d_0: the shift at which r was computed. Rows of a segment are stacked, one output after the other. A segment of
// which some readings do not count is scaled to the number of a whole one, so that its mean square is kept.
#pragma once

#include <optional>

#include "faultline/segments/segment_model.h"

namespace faultline {

// The start states of a run's segments as seen from a model.
class StartProjection {
 public:
  // `columns`: SegmentModel::start_columns(). `values`: readings that a whole segment has.
  StartProjection(const SegmentedRun& run, std::vector<Eigen::MatrixXf> columns, double values);

  const std::vector<Eigen::MatrixXf>& columns() const { return columns_; }
  std::size_t segments() const { return first_.size(); }
  // Whether another run is cut in the same way, so that this may serve for it.
  bool fits(const SegmentedRun& run) const;
  // w of a segment; the run says its shift.
  Eigen::VectorXd residual(const SegmentedRun& run, const Eigen::MatrixXf& residuals, std::size_t segment) const;
  // W of a segment.
  Eigen::MatrixXd whitened(const std::vector<const Eigen::MatrixXf*>& columns, std::size_t segment) const;

 private:
  void project(std::size_t segment, Eigen::Ref<Eigen::MatrixXd> columns) const;
  void stack(const Eigen::MatrixXf& matrix, std::size_t segment, Eigen::Ref<Eigen::VectorXd> column) const;

  std::vector<Eigen::MatrixXf> columns_;
  std::vector<Eigen::Index> first_;  // rows of the segments
  Eigen::Index length_;
  std::vector<double> scale_;            // per segment
  std::vector<Eigen::MatrixXd> starts_;  // S per segment
  std::vector<Eigen::MatrixXd> shrink_;  // K per segment: (I + S S')^(-1/2) = I - S K S'
};

// A direction in which the model may move: to `to`, which is `size` of it, seen from the model or from `from`.
struct Direction {
  ModelChange to;
  double size = 1;
  std::optional<ModelChange> from = {};
};

// One segment: w, and W with a column per direction, as many rows as w has also where there is none.
struct LinearSegment {
  Eigen::VectorXd residual;
  Eigen::MatrixXd columns;
};

// Residuals at a model, and their derivatives by the directions as differences; by segment. Simulates with
// `jobs` threads. `residuals`, if given, takes those at the model as they are.
std::vector<LinearSegment> linearise(const SegmentModel& model, const SegmentedRun& run, const StartProjection& starts,
                                     const std::vector<double>& sigma, const ModelChange& at,
                                     const std::vector<Direction>& directions, int jobs,
                                     Eigen::MatrixXf* residuals = nullptr);

}  // namespace faultline
