#include "faultline/gap/linearisation.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "faultline/numerics/in_parallel.h"

namespace faultline {

double robust(double loss, double values, double least) {
  return 0.5 * values * std::log(std::max(2 * loss / values, least));
}

double robust_weight(double loss, double values, double least) { return 1 / std::max(2 * loss / values, least); }

std::vector<Eigen::MatrixXf> residuals_of(const ResidualModel& model, const ModelChange& at,
                                          const std::vector<std::size_t>& runs, int jobs) {
  std::vector<Eigen::MatrixXf> result(runs.size());
  in_parallel(runs.size(), jobs, [&](std::size_t i) { result[i] = model.residuals(at, runs[i]); });
  return result;
}

std::vector<Eigen::MatrixXf> difference(const std::vector<Eigen::MatrixXf>& a, const std::vector<Eigen::MatrixXf>& b,
                                        double step) {
  std::vector<Eigen::MatrixXf> result;
  for (std::size_t i = 0; i < a.size(); ++i) result.push_back((a[i] - b[i]) / static_cast<float>(step));
  return result;
}

Eigen::VectorXd deviations(const Datasheet& sheet, const std::vector<std::size_t>& free,
                           const std::vector<double>& parameters) {
  Eigen::VectorXd z(static_cast<Eigen::Index>(free.size()));
  for (std::size_t i = 0; i < free.size(); ++i) {
    const Parameter& p = sheet.parameters[free[i]];
    z[static_cast<Eigen::Index>(i)] = (parameters[free[i]] - p.nominal) / (p.nominal * p.tolerance);
  }
  return z;
}

Linearisation::Linearisation(const ResidualModel& residuals, const ModelChange& model, std::vector<std::size_t> runs,
                             int jobs, std::vector<std::vector<Eigen::MatrixXf>> starts)
    : residuals_(residuals), runs_(std::move(runs)) {
  const Datasheet& sheet = residuals.sheet();
  for (std::size_t i = 0; i < sheet.parameters.size(); ++i)
    if (sheet.parameters[i].tolerance > 0) free_.push_back(i);
  at_model_ = residuals_of(residuals, model, runs_, jobs);
  std::vector<std::vector<Eigen::MatrixXf>> columns(free_.size());
  const bool known = !starts.empty();
  starts.resize(runs_.size());
  in_parallel(free_.size() + runs_.size(), jobs, [&](std::size_t i) {
    if (i >= free_.size()) {
      const std::size_t run = i - free_.size();
      if (!known) starts[run] = residuals.start_sensitivity(model, runs_[run]);
      return;
    }
    const Parameter& p = sheet.parameters[free_[i]];
    ModelChange moved = model;
    const double unit = p.nominal * p.tolerance;
    const double z = (model.parameters[free_[i]] - p.nominal) / unit;
    const double size = options().linearisation.difference_tolerances;
    const double step = z > 0 ? -size : size;
    moved.parameters[free_[i]] = model.parameters[free_[i]] + step * unit;
    columns[i] = difference(residuals_of(residuals, moved, runs_), at_model_, step);
  });
  around_.resize(runs_.size());
  in_parallel(runs_.size(), jobs, [&](std::size_t r) {
    auto around = std::make_shared<Around>(
        Around{StartProjection(residuals.runs()[runs_[r]], std::move(starts[r]), segment_values()), {}, {}});
    std::vector<const Eigen::MatrixXf*> own;
    for (const auto& column : columns) own.push_back(&column[r]);
    for (std::size_t g = 0; g < around->starts.segments(); ++g) {
      around->parameters.push_back(around->starts.whitened(own, g).cast<float>());
      const Eigen::MatrixXf& j = around->parameters.back();
      around->grams.push_back((j.transpose() * j).cast<double>());
    }
    around_[r] = std::move(around);
  });
  take_weights();
}

Linearisation::Linearisation(const ResidualModel& residuals, const ModelChange& model, const Linearisation& near)
    : residuals_(residuals), runs_(near.runs_), free_(near.free_), around_(near.around_) {
  at_model_ = residuals_of(residuals, model, runs_);
  take_weights();
}

void Linearisation::take_weights() {
  weights_.clear();
  parameter_grams_.clear();
  for (const double loss : segment_losses(at_model_)) weights_.push_back(robust_weight(loss));
  for (const auto& around : around_)
    parameter_grams_.insert(parameter_grams_.end(), around->grams.begin(), around->grams.end());
}

Linearisation Linearisation::subset(const std::vector<std::size_t>& positions) const {
  Linearisation part(residuals_);
  part.free_ = free_;
  for (const std::size_t i : positions) {
    part.runs_.push_back(runs_[i]);
    part.at_model_.push_back(at_model_[i]);
    part.around_.push_back(around_[i]);
  }
  part.take_weights();
  return part;
}

template <class Visit>
void Linearisation::for_each_segment(Visit&& visit) const {
  for (std::size_t r = 0; r < runs_.size(); ++r)
    for (std::size_t g = 0; g < around_[r]->starts.segments(); ++g) visit(r, g, *around_[r]);
}

SegmentProducts Linearisation::products(const std::vector<Eigen::MatrixXf>& residuals) const {
  SegmentProducts result;
  for_each_segment([&](std::size_t r, std::size_t g, const Around& around) {
    const Eigen::VectorXf w = around.starts.residual(residuals_.runs()[runs_[r]], residuals[r], g).cast<float>();
    result.squares.push_back(static_cast<double>(w.squaredNorm()));
    result.against_parameters.push_back((around.parameters[g].transpose() * w).cast<double>());
  });
  return result;
}

double Linearisation::robust(double loss) const {
  return faultline::robust(loss, segment_values(), options().linearisation.least_variance_fraction);
}

double Linearisation::robust_weight(double loss) const {
  return faultline::robust_weight(loss, segment_values(), options().linearisation.least_variance_fraction);
}

std::vector<double> Linearisation::segment_losses(const std::vector<Eigen::MatrixXf>& residuals) const {
  std::vector<double> losses;
  for_each_segment([&](std::size_t r, std::size_t g, const Around& around) {
    losses.push_back(0.5 * around.starts.residual(residuals_.runs()[runs_[r]], residuals[r], g).squaredNorm());
  });
  return losses;
}

std::vector<double> Linearisation::squares(const std::vector<Eigen::MatrixXf>& column) const {
  std::vector<double> result;
  for_each_segment([&](std::size_t r, std::size_t g, const Around& around) {
    result.push_back(around.starts.whitened({&column[r]}, g).squaredNorm());
  });
  return result;
}

Eigen::MatrixXd Linearisation::gram(const std::vector<Eigen::MatrixXf>& residuals, bool with_parameters,
                                    const std::vector<std::vector<Eigen::MatrixXf>>& columns,
                                    const std::vector<double>& weights, std::vector<Eigen::VectorXd>* gradients) const {
  const auto parameters = static_cast<Eigen::Index>(with_parameters ? free_.size() : 0);
  const Eigen::Index n = 1 + parameters + static_cast<Eigen::Index>(columns.size());
  Eigen::MatrixXd total = Eigen::MatrixXd::Zero(n, n);
  auto weight = weights.begin();
  for_each_segment([&](std::size_t r, std::size_t g, const Around& around) {
    std::vector<const Eigen::MatrixXf*> own;
    for (const auto& column : columns) own.push_back(&column[r]);
    const Eigen::VectorXd w = around.starts.residual(residuals_.runs()[runs_[r]], residuals[r], g);
    Eigen::MatrixXf all(w.size(), n);
    all.col(0) = w.cast<float>();
    if (parameters > 0) all.middleCols(1, parameters) = around.parameters[g];
    if (!own.empty())
      all.rightCols(static_cast<Eigen::Index>(own.size())) = around.starts.whitened(own, g).cast<float>();
    const Eigen::MatrixXd part = *weight++ * (all.transpose() * all).cast<double>();
    if (gradients) gradients->push_back(part.col(0).tail(n - 1));
    total += part;
  });
  return total;
}

Eigen::VectorXd bounded_move(const Eigen::MatrixXd& hessian, const Eigen::VectorXd& gradient, const Eigen::VectorXd& z,
                             const GapOptions::Linearisation& options) {
  const double bound = options.parameter_bound_tolerances;
  Eigen::VectorXd move = -hessian.ldlt().solve(gradient);
  std::vector<bool> held(static_cast<std::size_t>(z.size()), false);
  for (std::size_t pass = 0; pass < options.bound_passes; ++pass) {
    bool left = false;
    for (Eigen::Index i = 0; i < z.size(); ++i) {
      if (held[static_cast<std::size_t>(i)] || std::abs(z[i] + move[i]) <= bound) continue;
      held[static_cast<std::size_t>(i)] = left = true;
      move[i] = std::copysign(bound, z[i] + move[i]) - z[i];
    }
    if (!left) break;
    Eigen::MatrixXd part = hessian;
    Eigen::VectorXd rest = gradient;
    for (Eigen::Index i = 0; i < z.size(); ++i)
      if (held[static_cast<std::size_t>(i)]) rest += hessian.col(i) * move[i];
    for (Eigen::Index i = 0; i < z.size(); ++i) {
      if (!held[static_cast<std::size_t>(i)]) continue;
      part.row(i).setZero();
      part.col(i).setZero();
      part(i, i) = 1;
      rest[i] = -move[i];
    }
    move = -part.ldlt().solve(rest);
  }
  for (Eigen::Index i = 0; i < z.size(); ++i) move[i] = std::clamp(z[i] + move[i], -bound, bound) - z[i];
  return move;
}

double projected_loss(const Linearisation& linear, const SegmentProducts& products, const Eigen::VectorXd& z,
                      Eigen::VectorXd* best_move) {
  const GapOptions::Linearisation& options = linear.options().linearisation;
  const std::vector<Eigen::MatrixXd>& grams = linear.parameter_grams();
  Eigen::VectorXd move = Eigen::VectorXd::Zero(z.size());
  double best = 0;
  for (std::size_t step = 0; step <= options.reweightings; ++step) {
    Eigen::MatrixXd hessian = Eigen::MatrixXd::Identity(z.size(), z.size());
    Eigen::VectorXd gradient = z;
    double loss = 0.5 * (z + move).squaredNorm();
    for (std::size_t g = 0; g < grams.size(); ++g) {
      const Eigen::VectorXd& against = products.against_parameters[g];
      const double half = 0.5 * (products.squares[g] + 2 * against.dot(move) + move.dot(grams[g] * move));
      const double weight = linear.robust_weight(half);
      loss += linear.robust(half);
      hessian += weight * grams[g];
      gradient += weight * against;
    }
    if (step == 0 || loss < best) {
      best = loss;
      if (best_move) *best_move = move;
    }
    move = bounded_move(hessian, gradient, z, options);
  }
  return best;
}

}  // namespace faultline
