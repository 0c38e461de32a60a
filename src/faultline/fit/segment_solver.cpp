#include "faultline/fit/segment_solver.h"
#include "faultline/segments/state_smoother.h"

#include <algorithm>
#include <cmath>

#include <ceres/ceres.h>
#include <Eigen/QR>

#include "faultline/numerics/in_parallel.h"

namespace faultline {

// Ceres asks for the residual blocks one by one; all are computed at once when it moves.
class SegmentCosts : public ceres::EvaluationCallback {
 public:
  SegmentCosts(const SegmentSolver& solver, std::vector<double> values, const std::vector<std::size_t>& free)
      : solver_(solver), values_(std::move(values)), free_(free), z(free.size()) {
    for (std::size_t j = 0; j < free_.size(); ++j) z[j] = solver_.coordinate(free_[j], values_[free_[j]]);
  }
  void PrepareForEvaluation(bool derivatives, bool moved) override {
    if (!moved && (have_derivatives_ || !derivatives)) return;
    for (std::size_t j = 0; j < free_.size(); ++j) values_[free_[j]] = solver_.value(free_[j], z[j]);
    solver_.triangles(values_, free_,
                      derivatives ? SegmentSolver::Derivatives::forward : SegmentSolver::Derivatives::none, triangles);
    have_derivatives_ = derivatives;
  }
  const std::vector<double>& values() const { return values_; }

 private:
  const SegmentSolver& solver_;
  std::vector<double> values_;
  const std::vector<std::size_t>& free_;
  bool have_derivatives_ = false;

 public:
  std::vector<double> z;
  std::vector<Eigen::MatrixXd> triangles;
};

namespace {

class SegmentCost : public ceres::CostFunction {
 public:
  SegmentCost(const std::vector<Eigen::MatrixXd>& triangles, std::size_t at, int parameters)
      : triangles_(triangles), at_(at), parameters_(parameters) {
    set_num_residuals(parameters + 1);
    mutable_parameter_block_sizes()->push_back(parameters);
  }
  bool Evaluate(double const* const*, double* residuals, double** jacobians) const override {
    const Eigen::MatrixXd& t = triangles_[at_];
    const Eigen::Index n = parameters_;
    Eigen::Map<Eigen::VectorXd> r(residuals, n + 1);
    r = t.col(t.cols() - 1).head(n + 1);
    if (jacobians && jacobians[0])
      Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(jacobians[0], n + 1, n) =
          t.leftCols(n);
    return r.allFinite();
  }

 private:
  const std::vector<Eigen::MatrixXd>& triangles_;
  std::size_t at_;
  int parameters_;
};

// sqrt(k) z: what the tolerances know.
class ToleranceCost : public ceres::CostFunction {
 public:
  explicit ToleranceCost(const Eigen::VectorXd& weights) : roots_(weights.cwiseSqrt()) {
    set_num_residuals(static_cast<int>(roots_.size()));
    mutable_parameter_block_sizes()->push_back(static_cast<int>(roots_.size()));
  }
  bool Evaluate(double const* const* z, double* residuals, double** jacobians) const override {
    const Eigen::Index n = roots_.size();
    Eigen::Map<Eigen::VectorXd>(residuals, n) = roots_.cwiseProduct(Eigen::Map<const Eigen::VectorXd>(z[0], n));
    if (jacobians && jacobians[0]) Eigen::Map<Eigen::MatrixXd>(jacobians[0], n, n) = roots_.asDiagonal();
    return true;
  }

 private:
  Eigen::VectorXd roots_;
};

}  // namespace

SegmentSolver::SegmentSolver(const SegmentModel& model, std::vector<SegmentedRun> runs, std::vector<double> noise,
                             std::vector<double> scales, const FitOptions& options, int jobs)
    : model_(model),
      options_(options),
      runs_(std::move(runs)),
      noise_(std::move(noise)),
      sigma_(noise_),
      scales_(std::move(scales)),
      nominal_(model.sheet().nominal()),
      jobs_(jobs),
      weights_(nominal_.size(), 1.0) {
  for (const SegmentedRun& run : runs_) segments_ += run.restarts.size();
}

double SegmentSolver::coordinate(std::size_t parameter, double value) const {
  return std::log(value / nominal_[parameter]) / scales_[parameter];
}

double SegmentSolver::value(std::size_t parameter, double coordinate) const {
  return nominal_[parameter] * std::exp(coordinate * scales_[parameter]);
}

double SegmentSolver::cost(const std::vector<double>& values, const std::vector<std::size_t>& free) const {
  Columns all;
  triangles(values, {}, Derivatives::none, all);
  const double limit = options_.huber_sigma * std::sqrt(segment_values());
  double sum = 0;
  for (const Eigen::MatrixXd& one : all) {
    const double size = one(0, 0);
    sum += size <= limit ? 0.5 * size * size : limit * (std::abs(size) - 0.5 * limit);
  }
  for (const std::size_t index : free) sum += 0.5 * weights_[index] * std::pow(coordinate(index, values[index]), 2);
  return sum;
}

void SegmentSolver::set_correlation(const std::vector<double>& values) {
  const auto outputs = static_cast<Eigen::Index>(noise_.size());
  const auto lags = static_cast<Eigen::Index>(fewest_rows(runs_) / 2 + 1);
  // Products over lags of each output, sums over segments.
  Eigen::MatrixXd products = Eigen::MatrixXd::Zero(lags, outputs);
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    for (const Eigen::MatrixXd& stack : columns(values, {}, r, {})) {
      const Eigen::Index rows = stack.rows() / outputs;
      const double w = weight(stack.squaredNorm());
      for (Eigen::Index o = 0; o < outputs; ++o) {
        const auto part = stack.col(0).segment(o * rows, rows);
        for (Eigen::Index lag = 0; lag < std::min(lags, rows); ++lag)
          products(lag, o) += w * part.head(rows - lag).dot(part.tail(rows - lag));
      }
    }
  }
  double sum = 0;
  for (Eigen::Index o = 0; o < outputs; ++o) {
    double length = 1;
    for (Eigen::Index lag = 1; lag < products.rows() && products(lag, o) > 0; ++lag)
      length += 2 * products(lag, o) / products(0, o);
    sum += length / static_cast<double>(outputs);
  }
  correlation_ = sum;
}

Eigen::MatrixXd SegmentSolver::Information::covariance(double correlation) const {
  Eigen::MatrixXd result = few * correlation * hessian;
  if (few < 1) result += (1 - few) * blocks / (blocks - static_cast<double>(hessian.rows())) * scatter;
  return result;
}

void SegmentSolver::set_weights(const std::vector<double>& values, const std::vector<std::size_t>& free) {
  const Information info = information(values, free);
  const Eigen::MatrixXd covariance = info.covariance(correlation_);
  for (std::size_t j = 0; j < free.size(); ++j) {
    const auto i = static_cast<Eigen::Index>(j);
    weights_[free[j]] = correlation_;
    if (info.hessian(i, i) > 0) weights_[free[j]] = std::max(correlation_, covariance(i, i) / info.hessian(i, i));
  }
}

double SegmentSolver::segment_values() const {
  return static_cast<double>(fewest_rows(runs_) * model_.outputs().size());
}

double SegmentSolver::weight(double square) const {
  const double limit = options_.huber_sigma * std::sqrt(segment_values());
  const double size = std::sqrt(square);
  return size <= limit ? 1 : limit / size;
}

std::vector<double> SegmentSolver::misfit(const std::vector<double>& values) const {
  return over_segments([&](const SegmentedRun& run) { return model_.residuals({values, {}}, run, noise_); });
}

std::vector<double> SegmentSolver::free_misfit(const std::vector<double>& values) const {
  return over_segments([&](const SegmentedRun& run) {
    return model_.residuals({values, {}}, run, noise_, run.recording.rows());
  });
}

template <class Residuals>
std::vector<double> SegmentSolver::over_segments(Residuals&& residuals) const {
  std::vector<double> sums(sigma_.size(), 0);
  double rows = 0;
  for (const SegmentedRun& run : runs_) {
    const Eigen::MatrixXf r = residuals(run);
    for (const std::size_t row : run.restarts) {
      const auto part = r.middleRows(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(run.segment));
      for (std::size_t i = 0; i < sums.size(); ++i)
        sums[i] += part.col(static_cast<Eigen::Index>(i)).cast<double>().squaredNorm();
      rows += static_cast<double>(run.segment);
    }
  }
  for (std::size_t i = 0; i < sums.size(); ++i) sums[i] = noise_[i] * std::sqrt(sums[i] / rows);
  return sums;
}

void SegmentSolver::set_scatter(const std::vector<double>& values) {
  std::vector<std::vector<double>> squares(noise_.size());
  std::vector<Eigen::MatrixXf> residuals(runs_.size());
  in_parallel(runs_.size(), jobs_, [&](std::size_t r) {
    residuals[r] = model_.residuals({values, {}}, runs_[r], noise_);
  });
  for (std::size_t r = 0; r < runs_.size(); ++r)
    for (const std::size_t row : runs_[r].restarts)
      for (std::size_t i = 0; i < noise_.size(); ++i)
        squares[i].push_back(
            residuals[r]
                .col(static_cast<Eigen::Index>(i))
                .segment(static_cast<Eigen::Index>(row) + 1, static_cast<Eigen::Index>(runs_[r].segment) - 1)
                .cast<double>()
                .squaredNorm() /
            static_cast<double>(runs_[r].segment - 1));
  for (std::size_t i = 0; i < noise_.size(); ++i) {
    // Mean of the best: a few segments in which the model goes astray do not set the scale.
    std::sort(squares[i].begin(), squares[i].end());
    const std::size_t count = std::max<std::size_t>(
        1, static_cast<std::size_t>(options_.scatter_fraction * static_cast<double>(squares[i].size()) + 1e-9));
    double mean = 0;
    for (std::size_t k = 0; k < count; ++k) mean += squares[i][k] / static_cast<double>(count);
    sigma_[i] = noise_[i] * std::sqrt(std::max(1.0, mean));
  }
  place_starts(values);
}

void SegmentSolver::place_starts(const std::vector<double>& values) {
  std::vector<std::vector<Eigen::MatrixXf>> columns(runs_.size());
  in_parallel(runs_.size(), jobs_, [&](std::size_t r) {
    model_.place_starts(runs_[r], noise_, {values, {}});  // hidden states are as the model at hand has them
    columns[r] = model_.start_columns({values, {}}, runs_[r], sigma_);
  });
  starts_.clear();
  for (std::size_t r = 0; r < runs_.size(); ++r)
    starts_.emplace_back(runs_[r], std::move(columns[r]), segment_values());
}

bool SegmentSolver::has_hidden_states() const {
  return std::any_of(runs_.begin(), runs_.end(),
                     [&](const SegmentedRun& run) { return !hidden_states(model_, run).empty(); });
}

SegmentSolver::Columns SegmentSolver::columns(const std::vector<double>& values, const std::vector<std::size_t>& free,
                                              std::size_t run, const std::vector<Change>& changes, bool central) const {
  std::vector<Direction> directions;
  const auto move = [&](std::size_t index, double by) {
    Direction direction{{values, {}}, by};
    direction.to.parameters[index] *= std::exp(by * scales_[index]);
    directions.push_back(std::move(direction));
  };
  for (const std::size_t index : free) move(index, options_.difference_tolerances);
  for (const Change& change : changes) {
    directions.push_back({change.plus, 1});
    directions.push_back({change.minus, 1});
  }
  if (central)
    for (const std::size_t index : free) move(index, -options_.difference_tolerances);
  const std::vector<LinearSegment> linear =
      linearise(model_, runs_[run], starts_[run], sigma_, {values, {}}, directions, jobs_);
  const auto n = static_cast<Eigen::Index>(free.size()), m = static_cast<Eigen::Index>(changes.size());
  Columns result;
  for (const LinearSegment& segment : linear) {
    Eigen::MatrixXd all(segment.residual.size(), n + 1 + m);
    all.leftCols(n) = segment.columns.leftCols(n);
    if (central) all.leftCols(n) = 0.5 * (all.leftCols(n) + segment.columns.rightCols(n));
    all.col(n) = segment.residual;
    for (Eigen::Index c = 0; c < m; ++c)
      all.col(n + 1 + c) = segment.columns.col(n + 2 * c + 1) - segment.columns.col(n + 2 * c);
    result.push_back(std::move(all));
  }
  return result;
}

void SegmentSolver::triangles(const std::vector<double>& values, const std::vector<std::size_t>& free, Derivatives how,
                              Columns& result) const {
  const auto n = static_cast<Eigen::Index>(free.size());
  const bool derivatives = how != Derivatives::none;
  result.clear();
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    Columns stacks =
        columns(values, derivatives ? free : std::vector<std::size_t>(), r, {}, how == Derivatives::central);
    in_parallel(stacks.size(), jobs_, [&](std::size_t s) {
      Eigen::MatrixXd triangle = Eigen::MatrixXd::Zero(n + 1, n + 1);
      const Eigen::Index rows = std::min(n + 1, stacks[s].rows());  // a segment may hold fewer values than parameters
      if (derivatives)
        triangle.topRows(rows) =
            Eigen::HouseholderQR<Eigen::MatrixXd>(stacks[s]).matrixQR().topRows(rows).triangularView<Eigen::Upper>();
      else
        triangle(n, n) = stacks[s].norm();
      stacks[s] = std::move(triangle);
    });
    for (Eigen::MatrixXd& triangle : stacks) result.push_back(std::move(triangle));
  }
}

bool SegmentSolver::solve(std::vector<double>& values, const std::vector<std::size_t>& free,
                          std::size_t iterations) const {
  SegmentCosts costs(*this, values, free);
  ceres::Problem::Options problem_options;
  problem_options.evaluation_callback = &costs;
  ceres::Problem problem(problem_options);
  const int n = static_cast<int>(free.size());
  costs.triangles.assign(segments_, Eigen::MatrixXd::Zero(n + 1, n + 1));
  for (std::size_t s = 0; s < segments_; ++s)
    problem.AddResidualBlock(new SegmentCost(costs.triangles, s, n),
                             new ceres::HuberLoss(options_.huber_sigma * std::sqrt(segment_values())), costs.z.data());
  Eigen::VectorXd weights(n);
  for (int j = 0; j < n; ++j) weights[j] = weights_[free[static_cast<std::size_t>(j)]];
  problem.AddResidualBlock(new ToleranceCost(weights), nullptr, costs.z.data());
  for (int j = 0; j < n; ++j) {
    const double scale = scales_[free[static_cast<std::size_t>(j)]];
    problem.SetParameterLowerBound(costs.z.data(), j, std::log(options_.lowest_ratio) / scale);
    problem.SetParameterUpperBound(costs.z.data(), j, std::log(options_.highest_ratio) / scale);
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  options.max_num_iterations = static_cast<int>(iterations);
  options.function_tolerance = options_.cost_tolerance_fraction;
  options.parameter_tolerance = options_.step_tolerance_fraction;
  options.logging_type = ceres::SILENT;
  options.num_threads = 1;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  for (int j = 0; j < n; ++j) {
    const std::size_t index = free[static_cast<std::size_t>(j)];
    values[index] = value(index, costs.z[static_cast<std::size_t>(j)]);
  }
  return summary.termination_type == ceres::CONVERGENCE;
}

SegmentSolver::Information SegmentSolver::information(const std::vector<double>& values,
                                                      const std::vector<std::size_t>& free) const {
  const auto n = static_cast<Eigen::Index>(free.size());
  Information info{Eigen::MatrixXd::Zero(n, n), Eigen::MatrixXd::Zero(n, n)};
  Columns all;
  triangles(values, free, Derivatives::central, all);
  info.values = static_cast<double>(segments_) * segment_values() / correlation_;
  std::size_t at = 0;
  for (const SegmentedRun& run : runs_) {
    Eigen::VectorXd block = Eigen::VectorXd::Zero(n);
    for (std::size_t s = 0; s < run.restarts.size(); ++s, ++at) {
      const Eigen::MatrixXd jacobian = all[at].leftCols(n);
      const Eigen::VectorXd residual = all[at].col(n);
      const double w = weight(residual.squaredNorm());
      info.hessian += w * jacobian.transpose() * jacobian;
      block += w * jacobian.transpose() * residual;
      if ((s + 1) % options_.block_segments == 0 || s + 1 == run.restarts.size()) {
        info.scatter += block * block.transpose();
        ++info.blocks;
        block.setZero();
      }
    }
  }
  info.few = std::clamp(2 - info.blocks / static_cast<double>(n), 0.0, 1.0);
  return info;
}

Eigen::MatrixXd SegmentSolver::responses(const std::vector<double>& values, const std::vector<std::size_t>& free,
                                         const std::vector<Change>& changes) const {
  const auto n = static_cast<Eigen::Index>(free.size()), m = static_cast<Eigen::Index>(changes.size());
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(n, m);
  for (std::size_t r = 0; r < runs_.size(); ++r)
    for (const Eigen::MatrixXd& stack : columns(values, free, r, changes))
      sum += weight(stack.col(n).squaredNorm()) * stack.leftCols(n).transpose() * stack.rightCols(m);
  return sum;
}

}  // namespace faultline
