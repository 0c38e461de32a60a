#include "faultline/segments/linearisation.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "faultline/numerics/in_parallel.h"

namespace faultline {
namespace {

constexpr double kNoShare = 1e-12;  // of a squared singular value of S, below which there is nothing to project out

}  // namespace

StartProjection::StartProjection(const SegmentedRun& run, std::vector<Eigen::MatrixXf> columns, double values)
    : columns_(std::move(columns)), length_(static_cast<Eigen::Index>(run.segment)) {
  for (std::size_t g = 0; g < run.segments(); ++g) {
    first_.push_back(static_cast<Eigen::Index>(run.restarts[g]));
    scale_.push_back(std::sqrt(values / run.counted[g]));
    const Eigen::Index n = static_cast<Eigen::Index>(columns_.size());
    starts_.emplace_back();
    shrink_.emplace_back();
    if (n == 0) continue;
    Eigen::MatrixXd& starts = starts_.back();
    starts.resize(length_ * columns_.front().cols(), n);
    for (Eigen::Index i = 0; i < n; ++i) stack(columns_[static_cast<std::size_t>(i)], g, starts.col(i));
    // With S = U s V': (I + S S')^(-1/2) = I - U (1 - (1 + s^2)^(-1/2)) U', from the small Gram matrix S'S = V s^2 V'.
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(starts.transpose() * starts);
    Eigen::VectorXd factor(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const double square = std::max(0.0, eigen.eigenvalues()[i]);
      factor[i] = square < kNoShare ? 0 : (1 - 1 / std::sqrt(1 + square)) / square;
    }
    shrink_.back() = eigen.eigenvectors() * factor.asDiagonal() * eigen.eigenvectors().transpose();
  }
}

bool StartProjection::fits(const SegmentedRun& run) const {
  return length_ == static_cast<Eigen::Index>(run.segment) &&
         std::equal(first_.begin(), first_.end(), run.restarts.begin(), run.restarts.end(),
                    [](Eigen::Index a, std::size_t b) { return a == static_cast<Eigen::Index>(b); });
}

void StartProjection::stack(const Eigen::MatrixXf& matrix, std::size_t segment,
                            Eigen::Ref<Eigen::VectorXd> column) const {
  for (Eigen::Index o = 0; o < matrix.cols(); ++o)
    column.segment(o * length_, length_) = matrix.col(o).segment(first_[segment], length_).cast<double>();
  column *= scale_[segment];
}

void StartProjection::project(std::size_t segment, Eigen::Ref<Eigen::MatrixXd> columns) const {
  const Eigen::MatrixXd& starts = starts_[segment];
  if (starts.cols() > 0) columns.noalias() -= starts * (shrink_[segment] * (starts.transpose() * columns));
}

Eigen::VectorXd StartProjection::residual(const SegmentedRun& run, const Eigen::MatrixXf& residuals,
                                          std::size_t segment) const {
  Eigen::MatrixXd column(length_ * residuals.cols(), 1);
  stack(residuals, segment, column.col(0));
  const Eigen::VectorXd& shift = run.start_shift[segment];  // of memories there is none
  if (shift.size() > 0) column.col(0).noalias() -= starts_[segment].leftCols(shift.size()) * shift;
  project(segment, column);
  return column.col(0);
}

Eigen::MatrixXd StartProjection::whitened(const std::vector<const Eigen::MatrixXf*>& columns,
                                          std::size_t segment) const {
  Eigen::MatrixXd result(columns.empty() ? 0 : length_ * columns.front()->cols(),
                         static_cast<Eigen::Index>(columns.size()));
  for (Eigen::Index i = 0; i < result.cols(); ++i) stack(*columns[static_cast<std::size_t>(i)], segment, result.col(i));
  if (result.cols() > 0) project(segment, result);
  return result;
}

std::vector<LinearSegment> linearise(const SegmentModel& model, const SegmentedRun& run, const StartProjection& starts,
                                     const std::vector<double>& sigma, const ModelChange& at,
                                     const std::vector<Direction>& directions, int jobs, Eigen::MatrixXf* at_model) {
  std::vector<SegmentModel::Variant> variants{{&at, starts_of(run)}};
  for (const Direction& direction : directions) variants.push_back({&direction.to, variants.front().starts});
  for (const Direction& direction : directions)
    if (direction.from) variants.push_back({&*direction.from, variants.front().starts});
  // Central differences are asked for where forward ones are not exact enough.
  const bool central = variants.size() > 1 + directions.size();
  std::vector<Eigen::MatrixXf> residuals = model.residuals(
      variants, run, sigma, jobs, central ? SegmentModel::Beside::never : SegmentModel::Beside::as_asked);
  std::vector<const Eigen::MatrixXf*> columns;
  std::size_t from = directions.size();
  for (std::size_t i = 0; i < directions.size(); ++i) {
    const Eigen::MatrixXf& before = residuals[directions[i].from ? ++from : 0];
    residuals[i + 1] = (residuals[i + 1] - before) / static_cast<float>(directions[i].size);
    columns.push_back(&residuals[i + 1]);
  }
  std::vector<LinearSegment> result(run.segments());
  in_parallel(result.size(), jobs, [&](std::size_t g) {
    result[g].residual = starts.residual(run, residuals[0], g);
    result[g].columns = starts.whitened(columns, g);
    if (columns.empty()) result[g].columns.resize(result[g].residual.size(), 0);
  });
  if (at_model != nullptr) *at_model = std::move(residuals[0]);
  return result;
}

}  // namespace faultline
