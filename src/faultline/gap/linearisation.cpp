#include "faultline/gap/linearisation.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>

#include "faultline/attribution/screening.h"
#include "faultline/numerics/in_parallel.h"
#include "faultline/rig/parameter_range.h"

namespace faultline {

namespace {

// a' b, in single precision where the derivatives are no better.
Eigen::MatrixXd product(const Eigen::MatrixXf& a, const Eigen::MatrixXd& b, Differences differences) {
  if (differences == Differences::central) return a.cast<double>().transpose() * b;
  return (a.transpose() * b.cast<float>()).cast<double>();
}

}  // namespace

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

Eigen::VectorXd lowest_deviations(const Datasheet& sheet, const std::vector<std::size_t>& free,
                                  const GapOptions::Linearisation& options) {
  Eigen::VectorXd lowest(static_cast<Eigen::Index>(free.size()));
  for (std::size_t i = 0; i < free.size(); ++i)
    lowest[static_cast<Eigen::Index>(i)] =
        lowest_deviation(sheet.parameters[free[i]], options.parameter_bound_tolerances);
  return lowest;
}

Linearisation::Linearisation(const ResidualModel& residuals, const ModelChange& model, std::vector<std::size_t> runs,
                             int jobs, std::vector<std::vector<Eigen::MatrixXf>> starts, Differences differences)
    : residuals_(residuals), differences_(differences), runs_(std::move(runs)) {
  const Datasheet& sheet = residuals.sheet();
  for (std::size_t i = 0; i < sheet.parameters.size(); ++i)
    if (sheet.parameters[i].tolerance > 0) free_.push_back(i);
  at_model_.resize(runs_.size());
  around_.resize(runs_.size());
  std::vector<Direction> directions;
  for (const std::size_t i : free_) {
    const Parameter& p = sheet.parameters[i];
    const double unit = p.nominal * p.tolerance, size = options().linearisation.difference_tolerances;
    const double lowest = lowest_deviation(p, options().linearisation.parameter_bound_tolerances);
    directions.push_back({model, model.parameters[i] > p.nominal ? -size : size});
    Direction& direction = directions.back();
    direction.to.parameters[i] += direction.size * unit;
    if (differences == Differences::forward || (model.parameters[i] - p.nominal) / unit - size < lowest) continue;
    direction.from = model;
    direction.from->parameters[i] -= direction.size * unit;
    direction.size *= 2;
  }
  const bool known = !starts.empty();
  starts.resize(runs_.size());
  in_parallel(known ? 0 : runs_.size(), jobs,
              [&](std::size_t r) { starts[r] = residuals.start_sensitivity(model, runs_[r], jobs); });
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    const SegmentedRun& run = residuals.runs()[runs_[r]];
    auto around =
        std::make_shared<Around>(Around{StartProjection(run, std::move(starts[r]), segment_values()), {}, {}});
    for (const LinearSegment& segment :
         linearise(residuals.model(), run, around->starts, residuals.noise(), model, directions, jobs, &at_model_[r])) {
      around->parameters.push_back(segment.columns.cast<float>());
      const Eigen::MatrixXf& j = around->parameters.back();
      around->grams.push_back(product(j, j.cast<double>(), differences_));
    }
    around_[r] = std::move(around);
  }
  take_weights();
}

Linearisation::Linearisation(const ResidualModel& residuals, const ModelChange& model, const Linearisation& near,
                             int jobs)
    : residuals_(residuals),
      differences_(near.differences_),
      runs_(near.runs_),
      free_(near.free_),
      around_(near.around_) {
  at_model_ = residuals_of(residuals, model, runs_, jobs);
  take_weights();
}

void Linearisation::take_weights() {
  weights_.clear();
  for (const double loss : segment_losses(at_model_)) weights_.push_back(robust_weight(loss));
}

Linearisation Linearisation::subset(const std::vector<std::size_t>& positions) const {
  Linearisation part(residuals_);
  part.differences_ = differences_;
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

std::vector<Eigen::MatrixXd> Linearisation::products(const std::vector<Eigen::MatrixXf>& residuals,
                                                     const Columns& columns) const {
  std::vector<Eigen::MatrixXd> result;
  for_each_segment([&](std::size_t r, std::size_t g, const Around& around) {
    std::vector<const Eigen::MatrixXf*> own;
    for (const auto& column : columns) own.push_back(&column[r]);
    const Eigen::MatrixXf& parameters = around.parameters[g];
    const auto n = parameters.cols(), further = static_cast<Eigen::Index>(own.size());
    Eigen::MatrixXd rest(parameters.rows(), 1 + further);  // [r C]
    rest.col(0) = around.starts.residual(residuals_.runs()[runs_[r]], residuals[r], g);
    if (further > 0) rest.rightCols(further) = around.starts.whitened(own, g);
    const Eigen::MatrixXd squares = rest.transpose() * rest;
    const Eigen::MatrixXd against = product(parameters, rest, differences_);
    Eigen::MatrixXd gram(1 + n + further, 1 + n + further);
    gram.block(1, 1, n, n) = around.grams[g];
    gram(0, 0) = squares(0, 0);
    gram.block(0, 1, 1, n) = against.col(0).transpose();
    gram.block(1, 1 + n, n, further) = against.rightCols(further);
    gram.row(0).tail(further) = squares.row(0).tail(further);
    gram.bottomRightCorner(further, further) = squares.bottomRightCorner(further, further);
    result.push_back(gram.selfadjointView<Eigen::Upper>());
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

constexpr double kLittlePull = 1e-3;  // against a bound: half its square is what the loss would gain

// Primal active set: from within the bounds each step goes to the minimum of what is free, or up to the first bound in
// the way, so that none is worse than the one before.
Eigen::VectorXd bounded_move(const Eigen::MatrixXd& hessian, const Eigen::VectorXd& gradient, const Eigen::VectorXd& z,
                             const Eigen::VectorXd& lowest, const GapOptions::Linearisation& options) {
  const Eigen::Index n = gradient.size(), parameters = z.size();
  const double nowhere = std::numeric_limits<double>::infinity();
  Eigen::VectorXd low = Eigen::VectorXd::Constant(n, -nowhere), high = Eigen::VectorXd::Constant(n, nowhere);
  low.head(parameters) = lowest - z;
  high.head(parameters) = options.parameter_bound_tolerances - z.array();
  Eigen::VectorXd move = Eigen::VectorXd::Zero(n).cwiseMax(low).cwiseMin(high);
  std::vector<bool> held(static_cast<std::size_t>(n), false);
  for (std::size_t step = 0; step < options.bound_steps; ++step) {
    Eigen::MatrixXd part = hessian;
    Eigen::VectorXd downhill = -gradient - hessian * move;
    for (Eigen::Index i = 0; i < n; ++i) {
      if (!held[static_cast<std::size_t>(i)]) continue;
      part.row(i).setZero();
      part.col(i).setZero();
      part(i, i) = 1;
      downhill[i] = 0;
    }
    const Eigen::VectorXd way = part.ldlt().solve(downhill);
    double share = 1, end = 0;
    Eigen::Index first = -1;
    for (Eigen::Index i = 0; i < n; ++i) {
      const double to = move[i] + way[i], bound = to < low[i] ? low[i] : high[i];
      if (held[static_cast<std::size_t>(i)] || (to >= low[i] && to <= high[i])) continue;
      if (const double reached = (bound - move[i]) / way[i]; reached < share) share = reached, first = i, end = bound;
    }
    move = (move + share * way).cwiseMax(low).cwiseMin(high);
    if (first >= 0) {
      move[first] = end;
      held[static_cast<std::size_t>(first)] = true;
      continue;
    }
    // What is held and would rather go back is let go.
    const Eigen::VectorXd slope = gradient + hessian * move;
    double most = kLittlePull;
    Eigen::Index back = -1;
    for (Eigen::Index i = 0; i < n; ++i) {
      if (!held[static_cast<std::size_t>(i)]) continue;
      const double pull = (move[i] >= high[i] ? slope[i] : -slope[i]) / std::sqrt(hessian(i, i));
      if (pull > most) most = pull, back = i;
    }
    if (back < 0) break;
    held[static_cast<std::size_t>(back)] = false;
  }
  return move;
}

Adjusted adjusted(const Linearisation& linear, const std::vector<Eigen::MatrixXd>& products, const Eigen::VectorXd& z,
                  double fraction) {
  const GapOptions::Linearisation& options = linear.options().linearisation;
  const GapOptions::Screening& sizes = linear.options().screening;
  const Eigen::Index n = z.size(), all = products.empty() ? 1 + n : products.front().rows();
  const bool line = all > 1 + n;
  const Eigen::VectorXd lowest = lowest_deviations(linear.sheet(), linear.free_parameters(), options);
  Adjusted best, now{0, Eigen::VectorXd::Zero(n), line ? fraction : 0};
  Eigen::VectorXd at = Eigen::VectorXd::Ones(all);
  for (std::size_t step = 0; step <= options.reweightings; ++step) {
    at.segment(1, n) = now.move;
    at.tail(all - 1 - n).setConstant(now.fraction);
    Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(all, all);
    gram.topLeftCorner(1 + n, 1 + n) = known_to_tolerance(z);
    now.loss = 0.5 * (z + now.move).squaredNorm();
    for (const Eigen::MatrixXd& segment : products) {
      const double half = 0.5 * at.dot(segment * at);
      now.loss += linear.robust(half);
      gram += linear.robust_weight(half) * segment;
    }
    if (step == 0 || now.loss < best.loss) best = now;
    Eigen::VectorXd gradient = gram.col(0).segment(1, n);
    if (line) {
      now.fraction =
          best_size(without_parameters(gram, n), 1, sizes.least_size_fraction, sizes.largest_size_fraction).size;
      gradient += now.fraction * gram.col(1 + n).segment(1, n);
    }
    now.move = bounded_move(gram.block(1, 1, n, n), gradient, z, lowest, options);
  }
  return best;
}

}  // namespace faultline
