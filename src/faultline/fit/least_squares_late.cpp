// Of the library faultline_ceres: least_squares.h.
#include <ceres/ceres.h>

#include "faultline/fit/least_squares.h"

namespace faultline {
namespace {

// Ceres asks for the residual blocks one by one; all are computed at once when it moves.
class Blocks : public ceres::EvaluationCallback {
 public:
  Blocks(const LeastSquares& problem, std::vector<double> start)
      : z(std::move(start)),
        triangles(problem.blocks, Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(z.size()) + 1,
                                                        static_cast<Eigen::Index>(z.size()) + 1)),
        problem_(problem) {}
  void PrepareForEvaluation(bool derivatives, bool moved) override {
    if (!moved && (have_derivatives_ || !derivatives)) return;
    problem_.triangles(z, derivatives, triangles);
    have_derivatives_ = derivatives;
  }

  std::vector<double> z;
  std::vector<Eigen::MatrixXd> triangles;

 private:
  const LeastSquares& problem_;
  bool have_derivatives_ = false;
};

class BlockCost : public ceres::CostFunction {
 public:
  BlockCost(const std::vector<Eigen::MatrixXd>& triangles, std::size_t at, int parameters)
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

// sqrt(k) z: what is known of z beforehand.
class PriorCost : public ceres::CostFunction {
 public:
  explicit PriorCost(const std::vector<double>& weights)
      : roots_(
            Eigen::Map<const Eigen::VectorXd>(weights.data(), static_cast<Eigen::Index>(weights.size())).cwiseSqrt()) {
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
}  // namespace faultline

extern "C" bool faultline_minimise(const faultline::LeastSquares& problem, std::vector<double>& z) {
  using namespace faultline;
  Blocks blocks(problem, z);
  ceres::Problem::Options problem_options;
  problem_options.evaluation_callback = &blocks;
  ceres::Problem ceres_problem(problem_options);
  const int n = static_cast<int>(z.size());
  for (std::size_t b = 0; b < problem.blocks; ++b)
    ceres_problem.AddResidualBlock(new BlockCost(blocks.triangles, b, n), new ceres::HuberLoss(problem.huber),
                                   blocks.z.data());
  ceres_problem.AddResidualBlock(new PriorCost(problem.weights), nullptr, blocks.z.data());
  for (int j = 0; j < n; ++j) {
    ceres_problem.SetParameterLowerBound(blocks.z.data(), j, problem.lowest[static_cast<std::size_t>(j)]);
    ceres_problem.SetParameterUpperBound(blocks.z.data(), j, problem.highest[static_cast<std::size_t>(j)]);
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  options.max_num_iterations = problem.iterations;
  options.function_tolerance = problem.cost_tolerance;
  options.parameter_tolerance = problem.step_tolerance;
  options.logging_type = ceres::SILENT;
  options.num_threads = 1;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &ceres_problem, &summary);
  z = blocks.z;
  return summary.termination_type == ceres::CONVERGENCE;
}
