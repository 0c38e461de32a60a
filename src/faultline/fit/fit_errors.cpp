#include "faultline/fit/fit_errors.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace faultline {
namespace {

constexpr double kLeastInformation = 1e-9;  // per squared tolerance: a guard against what no run shows

}  // namespace

FitErrors fit_errors(const SegmentSolver& solver, const Datasheet& sheet, const std::vector<double>& values,
                     const std::vector<std::size_t>& free) {
  FitErrors e;
  const SegmentSolver::Information info = solver.information(values, free);
  const double c = solver.correlation();
  const Eigen::Index n = info.hessian.rows();
  Eigen::VectorXd prior(n);
  for (Eigen::Index i = 0; i < n; ++i) prior[i] = solver.weight_of(free[static_cast<std::size_t>(i)]);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(info.hessian);
  const Eigen::VectorXd known = eigen.eigenvalues().cwiseMax(kLeastInformation * c);
  const Eigen::MatrixXd inverse =
      eigen.eigenvectors() * known.cwiseInverse().asDiagonal() * eigen.eigenvectors().transpose();
  const Eigen::MatrixXd scatter = info.covariance(c);
  e.variance = inverse * scatter * inverse;
  for (Eigen::Index v = 0; v < n; ++v) {
    const Eigen::VectorXd direction = eigen.eigenvectors().col(v);
    const double same = std::max(1.0, direction.dot(scatter * direction) / known[v]);
    if (known[v] >= same) continue;
    e.variance += same / known[v] * direction * direction.transpose();
    e.unseen.conservativeResize(n, e.unseen.cols() + 1);
    e.unseen.rightCols(1) = direction;
  }
  e.freedom = std::max(1.0, (1 - info.few) * info.blocks + info.few * info.values - static_cast<double>(n));
  e.conditional.resize(n);
  for (Eigen::Index i = 0; i < n; ++i)
    e.conditional[i] = std::sqrt(scatter(i, i)) / std::max(info.hessian(i, i), kLeastInformation * c);
  e.posterior = (e.variance.diagonal().array() / (1 + e.variance.diagonal().array())).sqrt();
  const Eigen::MatrixXd whole = info.hessian + Eigen::MatrixXd(prior.asDiagonal());
  e.curvature = Eigen::LDLT<Eigen::MatrixXd>(whole).solve(Eigen::MatrixXd::Identity(n, n));

  std::vector<SegmentSolver::Change> changes;
  for (std::size_t i = 0; i < sheet.parameters.size(); ++i) {
    if (sheet.parameters[i].tolerance <= 0 || std::find(free.begin(), free.end(), i) != free.end()) continue;
    std::vector<double> plus = values, minus = values;
    plus[i] *= 1 + 0.5 * sheet.parameters[i].tolerance;
    minus[i] *= 1 - 0.5 * sheet.parameters[i].tolerance;
    changes.push_back({{plus, {}}, {minus, {}}});
  }
  for (const std::string& text : sheet.nuisance) changes.push_back({{values, {parse_effect(text)}}, {values, {}}});
  e.systematic = (e.curvature * solver.responses(values, free, changes)).rowwise().squaredNorm();
  return e;
}

Widening profile(const SegmentSolver& solver, const FitErrors& errors, const std::vector<double>& values,
                 const std::vector<std::size_t>& free, std::size_t at, double half_width, double farthest,
                 const FitOptions& options) {
  const auto i = static_cast<Eigen::Index>(at);
  const double here = solver.cost(values, free), curvature = 1 / errors.curvature(i, i);
  const double wanted = 0.5 * curvature * half_width * half_width;
  std::vector<std::size_t> others = free;
  others.erase(others.begin() + static_cast<std::ptrdiff_t>(at));
  // The cost `move` away from the estimate, the others following as the Hessian says, or fitted.
  const auto rise = [&](double move, bool fitted) {
    std::vector<double> there = values;
    for (std::size_t j = 0; j < free.size(); ++j) {
      const double follow = move * errors.curvature(static_cast<Eigen::Index>(j), i) * curvature;
      there[free[j]] = solver.value(free[j], solver.coordinate(free[j], values[free[j]]) + follow);
    }
    if (fitted && !others.empty()) solver.solve(there, others, options.next_iterations);
    return solver.cost(there, free) - here;
  };
  const auto widening = [&](double side) {
    double ratio = 1;
    double risen = rise(side * half_width, false);
    // Only where the linear model of the valley is doubted: as long as it is right, its floor is where it says.
    if (risen > options.valley_ratio * wanted) risen = rise(side * half_width, true);
    while (risen < wanted / options.valley_ratio && ratio * half_width < farthest) {
      ratio = std::min(1.5 * ratio, farthest / half_width);
      risen = rise(side * ratio * half_width, true);
    }
    return ratio;
  };
  return {widening(-1), widening(1)};
}

std::string reason_undetermined(const Datasheet& sheet, const std::vector<double>& scales, const FitErrors& errors,
                                const std::vector<std::size_t>& free, std::size_t at, const FitOptions& options) {
  const auto i = static_cast<Eigen::Index>(at);
  if (errors.conditional[i] > options.seen_error_tolerances)
    return fmt::format("these runs hardly respond to it: alone it would be known to {:.2g} tolerances",
                       errors.conditional[i]);
  // What moves along with it, unseen.
  if (errors.unseen.cols() > 0) {
    const Eigen::VectorXd direction = errors.unseen * errors.unseen.row(i).transpose();
    std::string with;
    for (std::size_t j = 0; j < free.size(); ++j) {
      if (j == at) continue;
      const double ratio =
          direction[static_cast<Eigen::Index>(j)] * scales[free[j]] / (direction[i] * scales[free[at]]);
      if (!(std::abs(ratio) > options.named_exponent)) continue;
      with += fmt::format("{}{} by {:+.2g} %", with.empty() ? "" : ", ", sheet.parameters[free[j]].name, ratio);
    }
    if (!with.empty() && std::abs(direction[i]) > options.named_exponent * direction.cwiseAbs().maxCoeff())
      return "only a combination is determined; these runs do not see when it moves by +1 % and " + with;
  }
  if (errors.systematic[i] > errors.variance(i, i))
    return "what else may be off in the model (tolerances, nuisance effects) moves it by more than its tolerance";
  return "these runs are too short or too poorly explained to know it better than the datasheet";
}

}  // namespace faultline
