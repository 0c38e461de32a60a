#include "faultline/gap/linearisation.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "faultline/numerics/in_parallel.h"

namespace faultline {

double robust(double loss, double values, double least) {
  return 0.5 * values * std::log(std::max(2 * loss / values, least));
}

double robust_weight(double loss, double values, double least) { return 1 / std::max(2 * loss / values, least); }

std::vector<Eigen::MatrixXf> residuals_of(const ResidualModel& model, const GapModel& at,
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

Linearisation::Linearisation(const ResidualModel& residuals, const GapModel& model, std::vector<std::size_t> runs,
                             int jobs, std::vector<std::vector<Eigen::MatrixXf>> starts)
    : residuals_(residuals), runs_(std::move(runs)), starts_(std::move(starts)) {
  const Datasheet& sheet = residuals.sheet();
  for (std::size_t i = 0; i < sheet.parameters.size(); ++i)
    if (sheet.parameters[i].tolerance > 0) free_.push_back(i);
  at_model_ = residuals_of(residuals, model, runs_);
  columns_.resize(free_.size());
  const bool known = !starts_.empty();
  starts_.resize(runs_.size());
  for (const std::size_t run : runs_) shifts_.push_back(residuals.start_shift(run));
  in_parallel(free_.size() + runs_.size(), jobs, [&](std::size_t i) {
    if (i >= free_.size()) {
      const std::size_t run = i - free_.size();
      if (!known) starts_[run] = residuals.start_sensitivity(model, runs_[run]);
      return;
    }
    const Parameter& p = sheet.parameters[free_[i]];
    GapModel moved = model;
    const double unit = p.nominal * p.tolerance;
    const double z = (model.parameters[free_[i]] - p.nominal) / unit;
    const double size = options().linearisation.difference_tolerances;
    const double step = z > 0 ? -size : size;
    moved.parameters[free_[i]] = model.parameters[free_[i]] + step * unit;
    columns_[i] = difference(residuals_of(residuals, moved, runs_), at_model_, step);
  });
  prepare();
}

Linearisation::Linearisation(const ResidualModel& residuals, const GapModel& model, const Linearisation& near)
    : residuals_(residuals), runs_(near.runs_), free_(near.free_), columns_(near.columns_), starts_(near.starts_) {
  at_model_ = residuals_of(residuals, model, runs_);
  for (const std::size_t run : runs_) shifts_.push_back(residuals.start_shift(run));
  prepare();
}

void Linearisation::prepare() {
  inverse_.resize(runs_.size());
  const auto length = static_cast<Eigen::Index>(residuals_.segment());
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    const auto& s = starts_[r];
    const auto n = static_cast<Eigen::Index>(s.size());
    for (std::size_t g = 0; g < residuals_.runs()[runs_[r]].segments(); ++g) {
      const auto first = static_cast<Eigen::Index>(g) * length;
      Eigen::MatrixXd information = Eigen::MatrixXd::Identity(n, n);
      for (Eigen::Index i = 0; i < n; ++i)
        for (Eigen::Index j = 0; j <= i; ++j) {
          const double sum =
              static_cast<double>(s[static_cast<std::size_t>(i)]
                                      .middleRows(first, length)
                                      .cwiseProduct(s[static_cast<std::size_t>(j)].middleRows(first, length))
                                      .sum());
          information(i, j) += sum;
          if (i != j) information(j, i) += sum;
        }
      inverse_[r].push_back(information.inverse());
    }
  }
  weights_.clear();
  for (const double loss : segment_losses(at_model_)) weights_.push_back(robust_weight(loss));
  cross_.assign(runs_.size(), {});
  const auto parameters = static_cast<Eigen::Index>(columns_.size());
  for (std::size_t r = 0; r < runs_.size(); ++r)
    for (std::size_t g = 0; g < inverse_[r].size(); ++g) {
      const auto first = static_cast<Eigen::Index>(g) * length;
      Eigen::MatrixXd cross(static_cast<Eigen::Index>(starts_[r].size()), parameters);
      for (Eigen::Index i = 0; i < cross.rows(); ++i)
        for (Eigen::Index j = 0; j < parameters; ++j)
          cross(i, j) =
              static_cast<double>(starts_[r][static_cast<std::size_t>(i)]
                                      .middleRows(first, length)
                                      .cwiseProduct(columns_[static_cast<std::size_t>(j)][r].middleRows(first, length))
                                      .sum());
      cross_[r].push_back(cross);
    }
  parameter_grams_.clear();
  const auto outputs = static_cast<Eigen::Index>(residuals_.outputs().size());
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    Eigen::MatrixXf stacked(length * outputs, parameters);
    for (std::size_t g = 0; g < inverse_[r].size(); ++g) {
      const auto first = static_cast<Eigen::Index>(g) * length;
      for (Eigen::Index j = 0; j < parameters; ++j)
        for (Eigen::Index o = 0; o < outputs; ++o)
          stacked.col(j).segment(o * length, length) =
              columns_[static_cast<std::size_t>(j)][r].col(o).segment(first, length);
      const Eigen::MatrixXd& cross = cross_[r][g];
      parameter_grams_.push_back((stacked.transpose() * stacked).cast<double>() -
                                 cross.transpose() * inverse_[r][g] * cross);
    }
  }
}

Linearisation Linearisation::subset(const std::vector<std::size_t>& positions) const {
  Linearisation part(residuals_);
  part.free_ = free_;
  part.columns_.resize(columns_.size());
  for (const std::size_t i : positions) {
    part.runs_.push_back(runs_[i]);
    part.at_model_.push_back(at_model_[i]);
    part.starts_.push_back(starts_[i]);
    part.shifts_.push_back(shifts_[i]);
    for (std::size_t c = 0; c < columns_.size(); ++c) part.columns_[c].push_back(columns_[c][i]);
  }
  part.prepare();
  return part;
}

SegmentProducts Linearisation::products(const std::vector<Eigen::MatrixXf>& residuals) const {
  const auto length = static_cast<Eigen::Index>(residuals_.segment());
  const auto parameters = static_cast<Eigen::Index>(columns_.size());
  SegmentProducts result;
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    const auto n = static_cast<Eigen::Index>(starts_[r].size());
    for (std::size_t g = 0; g < inverse_[r].size(); ++g) {
      const auto first = static_cast<Eigen::Index>(g) * length;
      const auto part = residuals[r].middleRows(first, length);
      Eigen::VectorXd against = shifts_[r].row(static_cast<Eigen::Index>(g)).transpose();
      const double shift = against.squaredNorm();
      for (Eigen::Index i = 0; i < n; ++i)
        against[i] += static_cast<double>(
            starts_[r][static_cast<std::size_t>(i)].middleRows(first, length).cwiseProduct(part).sum());
      const Eigen::VectorXd solved = inverse_[r][g] * against;
      result.squares.push_back(static_cast<double>(part.squaredNorm()) + shift - against.dot(solved));
      Eigen::VectorXd products = -cross_[r][g].transpose() * solved;
      for (Eigen::Index j = 0; j < parameters; ++j)
        products[j] += static_cast<double>(
            columns_[static_cast<std::size_t>(j)][r].middleRows(first, length).cwiseProduct(part).sum());
      result.against_parameters.push_back(products);
    }
  }
  return result;
}

double Linearisation::segment_values() const {
  return static_cast<double>(residuals_.segment() * residuals_.outputs().size());
}

double Linearisation::robust(double loss) const {
  return faultline::robust(loss, segment_values(), options().linearisation.least_variance_fraction);
}

double Linearisation::robust_weight(double loss) const {
  return faultline::robust_weight(loss, segment_values(), options().linearisation.least_variance_fraction);
}

double Linearisation::values() const {
  double count = 0;
  for (std::size_t r = 0; r < runs_.size(); ++r)
    count += static_cast<double>(inverse_[r].size() * residuals_.segment() * residuals_.outputs().size());
  return count;
}

std::vector<double> Linearisation::segment_losses(const std::vector<Eigen::MatrixXf>& residuals) const {
  std::vector<double> losses;
  const auto length = static_cast<Eigen::Index>(residuals_.segment());
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    const auto n = static_cast<Eigen::Index>(starts_[r].size());
    for (std::size_t g = 0; g < inverse_[r].size(); ++g) {
      const auto part = residuals[r].middleRows(static_cast<Eigen::Index>(g) * length, length);
      Eigen::VectorXd against(n);
      for (Eigen::Index i = 0; i < n; ++i)
        against[i] = static_cast<double>(starts_[r][static_cast<std::size_t>(i)]
                                             .middleRows(static_cast<Eigen::Index>(g) * length, length)
                                             .cwiseProduct(part)
                                             .sum());
      const Eigen::VectorXd shift = shifts_[r].row(static_cast<Eigen::Index>(g)).transpose();
      against += shift;
      losses.push_back(0.5 * (static_cast<double>(part.squaredNorm()) + shift.squaredNorm() -
                              against.dot(inverse_[r][g] * against)));
    }
  }
  return losses;
}

Eigen::MatrixXd Linearisation::gram(const std::vector<const std::vector<Eigen::MatrixXf>*>& columns,
                                    const std::vector<double>& weights, std::vector<Eigen::VectorXd>* gradients) const {
  const auto n = static_cast<Eigen::Index>(columns.size());
  const auto length = static_cast<Eigen::Index>(residuals_.segment());
  Eigen::MatrixXd total = Eigen::MatrixXd::Zero(n, n);
  const auto outputs = static_cast<Eigen::Index>(residuals_.outputs().size());
  auto weight = weights.begin();
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    const auto shown = static_cast<Eigen::Index>(starts_[r].size());
    Eigen::MatrixXf stacked(length * outputs, n + shown);
    for (std::size_t g = 0; g < inverse_[r].size(); ++g) {
      const auto first = static_cast<Eigen::Index>(g) * length;
      for (Eigen::Index i = 0; i < n + shown; ++i) {
        const Eigen::MatrixXf& column =
            i < n ? (*columns[static_cast<std::size_t>(i)])[r] : starts_[r][static_cast<std::size_t>(i - n)];
        for (Eigen::Index o = 0; o < outputs; ++o)
          stacked.col(i).segment(o * length, length) = column.col(o).segment(first, length);
      }
      Eigen::MatrixXd all = (stacked.transpose() * stacked).cast<double>();
      const Eigen::VectorXd shift = shifts_[r].row(static_cast<Eigen::Index>(g)).transpose();
      all.block(n, 0, shown, 1) += shift;
      all(0, 0) += shift.squaredNorm();
      const auto cross = all.bottomLeftCorner(shown, n);
      const Eigen::MatrixXd part = *weight++ * (all.topLeftCorner(n, n) - cross.transpose() * inverse_[r][g] * cross);
      if (gradients) gradients->push_back(part.col(0).tail(n - 1));
      total += part;
    }
  }
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
