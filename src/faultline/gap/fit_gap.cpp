#include "faultline/gap/fit_gap.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "faultline/gap/ridge.h"
#include "faultline/numerics/in_parallel.h"
#include "faultline/rig/parameter_range.h"

namespace faultline {
namespace {

constexpr double kNothing = 1e-9;  // of information: keeps a matrix regular where a parameter does nothing

using Coordinates = std::vector<std::pair<std::size_t, std::size_t>>;  // (effect, parameter)

Coordinates coordinates_of(const std::vector<Candidate>& effects) {
  Coordinates result;
  for (std::size_t e = 0; e < effects.size(); ++e)
    for (std::size_t p = 0; p < effects[e].bounds.size(); ++p)
      if (effects[e].bounds[p].minimum < effects[e].bounds[p].maximum) result.emplace_back(e, p);
  return result;
}

double coordinate(const std::vector<Candidate>& effects, std::pair<std::size_t, std::size_t> at) {
  return effects[at.first].to_coordinate(at.second, effects[at.first].effect.parameters[at.second]);
}

void set_coordinate(std::vector<Candidate>& effects, std::pair<std::size_t, std::size_t> at, double value) {
  effects[at.first].effect.parameters[at.second] = effects[at.first].from_coordinate(at.second, value);
}

// Moves along the tangent in the effect's own unit: an effect that is a parameter's twin then trades with it exactly,
// whatever the coordinate's scale. Large moves go by the coordinate.
void move_coordinate(std::vector<Candidate>& effects, std::pair<std::size_t, std::size_t> at, double step,
                     const GapOptions::Fit& options) {
  Candidate& candidate = effects[at.first];
  double& value = candidate.effect.parameters[at.second];
  const double c = candidate.to_coordinate(at.second, value);
  const double tiny = c > 0.5 ? -options.difference_coordinate : options.difference_coordinate;
  const double slope = (candidate.from_coordinate(at.second, c + tiny) - value) / tiny;
  const double tangent = value + slope * step;
  const double along = candidate.from_coordinate(at.second, c + step);
  const bool near = candidate.logarithmic(at.second)
                        ? tangent > value / options.tangent_ratio && tangent < options.tangent_ratio * value
                        : true;
  const Bounds& b = candidate.bounds[at.second];
  value = near ? std::clamp(tangent, b.minimum, b.maximum) : along;
}

std::vector<std::vector<Eigen::MatrixXf>> effect_sensitivity(const ResidualModel& residuals, const FitResult& at,
                                                             const Coordinates& coordinates,
                                                             const std::vector<Eigen::MatrixXf>& now,
                                                             const Linearisation& linear, int jobs) {
  std::vector<std::vector<Eigen::MatrixXf>> columns(coordinates.size());
  in_parallel(coordinates.size(), jobs, [&](std::size_t i) {
    const auto& which = coordinates[i];
    std::vector<Candidate> moved = at.effects;
    const double c = coordinate(moved, which), size = residuals.options().fit.difference_coordinate;
    const auto residuals_at = [&](double to) {
      set_coordinate(moved, which, to);
      return residuals_of(residuals, with_effects(moved, at.model.parameters), linear.runs(), jobs);
    };
    if (linear.differences() == Differences::central && c >= size && c + size <= 1)
      columns[i] = difference(residuals_at(c + size), residuals_at(c - size), 2 * size);
    else
      columns[i] = difference(residuals_at(c > 0.5 ? c - size : c + size), now, c > 0.5 ? -size : size);
  });
  return columns;
}

// What a step of `size` along a ridge does, to both sides where parameters are not at their bounds; per unit.
std::vector<Eigen::MatrixXf> response_along(const ResidualModel& residuals, const FitResult& at,
                                            const Coordinates& coordinates, const Ridge& ridge,
                                            const std::vector<Eigen::MatrixXf>& now, const Linearisation& linear,
                                            int jobs) {
  const std::vector<std::size_t>& free = linear.free_parameters();
  const auto parameters = static_cast<Eigen::Index>(free.size());
  const double largest = std::max(ridge.along.head(parameters).lpNorm<Eigen::Infinity>(),
                                  ridge.along.tail(ridge.along.size() - parameters).lpNorm<Eigen::Infinity>() /
                                      residuals.options().fit.ridge_step_coordinate);
  const double step = residuals.options().fit.ridge_step_tolerances / largest;
  const auto moved = [&](double by, std::vector<Eigen::MatrixXf>& result) {
    std::vector<double> values = at.model.parameters;
    const Eigen::VectorXd wanted = by * ridge.along.head(parameters);
    const Eigen::VectorXd before = deviations(residuals.sheet(), free, values);
    shift_parameters(residuals, free, wanted, values);
    if ((deviations(residuals.sheet(), free, values) - before - wanted).lpNorm<Eigen::Infinity>() > 1e-9) return false;
    std::vector<Candidate> list = at.effects;
    for (std::size_t i = 0; i < coordinates.size(); ++i)
      move_coordinate(list, coordinates[i], by * ridge.along[parameters + static_cast<Eigen::Index>(i)],
                      residuals.options().fit);
    result = residuals_of(residuals, with_effects(list, values), linear.runs(), jobs);
    return true;
  };
  std::vector<Eigen::MatrixXf> after = now, before = now;
  const bool up = moved(step, after), down = moved(-step, before);
  return difference(after, before, (up + down) * (up || down ? step : 1.0));
}

}  // namespace

void shift_parameters(const ResidualModel& residuals, const std::vector<std::size_t>& free, const Eigen::VectorXd& step,
                      std::vector<double>& parameters) {
  const double bound = residuals.options().linearisation.parameter_bound_tolerances;
  for (std::size_t i = 0; i < free.size(); ++i) {
    const Parameter& p = residuals.sheet().parameters[free[i]];
    const double unit = p.nominal * p.tolerance;
    const double z = std::clamp((parameters[free[i]] - p.nominal) / unit + step[static_cast<Eigen::Index>(i)],
                                lowest_deviation(p, bound), bound);
    parameters[free[i]] = p.nominal + z * unit;
  }
}

ModelChange with_effects(const std::vector<Candidate>& effects, const std::vector<double>& parameters) {
  ModelChange model;
  model.parameters = parameters;
  for (const Candidate& candidate : effects) model.effects.push_back(candidate.effect);
  return model;
}

FitResult fit_gap(const ResidualModel& residuals, const ModelChange& start, const std::vector<Candidate>& effects,
                  const Linearisation& linear, std::size_t iterations, int jobs, bool parameters_move) {
  const GapOptions::Fit& options = residuals.options().fit;
  const Datasheet& sheet = residuals.sheet();
  const std::vector<std::size_t>& free = linear.free_parameters();
  const auto parameters = static_cast<Eigen::Index>(parameters_move ? free.size() : 0);
  const Coordinates coordinates = coordinates_of(effects);
  const auto extra = static_cast<Eigen::Index>(coordinates.size());
  const auto from_start = [&](const std::vector<Candidate>& list) {
    Eigen::VectorXd c(extra);
    for (Eigen::Index i = 0; i < extra; ++i) {
      const auto& which = coordinates[static_cast<std::size_t>(i)];
      c[i] = coordinate(list, which) - coordinate(effects, which);
    }
    return c;
  };
  const auto loss_of = [&](const std::vector<Eigen::MatrixXf>& r, const std::vector<Candidate>& list,
                           const std::vector<double>& values) {
    double sum = 0;
    for (const double loss : linear.segment_losses(r)) sum += linear.robust(loss);
    return sum + 0.5 * deviations(sheet, free, values).squaredNorm() + 0.5 * from_start(list).squaredNorm();
  };

  const Eigen::VectorXd lowest =
      parameters_move ? lowest_deviations(sheet, free, residuals.options().linearisation) : Eigen::VectorXd();
  struct Point {
    FitResult fit;
    std::vector<Eigen::MatrixXf> residuals;
  };
  const auto at = [&](const std::vector<double>& values, const std::vector<Candidate>& list) {
    Point point;
    point.fit.effects = list;
    point.fit.model = with_effects(list, values);
    point.residuals = residuals_of(residuals, point.fit.model, linear.runs(), jobs);
    point.fit.loss = loss_of(point.residuals, list, values);
    return point;
  };
  const auto z_of = [&](const Point& point) {
    return parameters_move ? deviations(sheet, free, point.fit.model.parameters) : Eigen::VectorXd();
  };
  const auto moved = [&](const Point& from, Eigen::VectorXd move) {
    move.tail(extra) =
        move.tail(extra).cwiseMax(-options.largest_step_coordinate).cwiseMin(options.largest_step_coordinate);
    std::vector<double> values = from.fit.model.parameters;
    if (parameters_move) shift_parameters(residuals, free, move.head(parameters), values);
    std::vector<Candidate> list = from.fit.effects;
    for (std::size_t i = 0; i < coordinates.size(); ++i)
      move_coordinate(list, coordinates[i], move[parameters + static_cast<Eigen::Index>(i)], options);
    return at(values, list);
  };
  const Eigen::Index n = parameters + extra;  // without parameters, the last rows are the effects'

  Point now = at(start.parameters, effects);
  const bool closely = linear.differences() == Differences::central;
  const double settled = closely ? options.polished_log_likelihood : options.settled_log_likelihood;
  double damping = 0;
  for (std::size_t iteration = 0; iteration < iterations; ++iteration) {
    auto columns = effect_sensitivity(residuals, now.fit, coordinates, now.residuals, linear, jobs);
    std::optional<Ridge> ridge;
    const auto gram_of = [&](const Point& point) {
      Eigen::MatrixXd gram;
      for (const Eigen::MatrixXd& segment : linear.products(point.residuals, columns)) {
        if (gram.size() == 0) gram.setZero(segment.rows(), segment.cols());
        gram += linear.robust_weight(0.5 * segment(0, 0)) * segment;
      }
      return ridge ? straightened(gram, *ridge) : gram;
    };
    Eigen::MatrixXd gram = gram_of(now);
    if (closely && parameters_move) {
      const Ridge found = weakest(gram.bottomRightCorner(n, n));
      columns.push_back(response_along(residuals, now.fit, coordinates, found, now.residuals, linear, jobs));
      ridge = found;
      gram = gram_of(now);
    }
    Eigen::MatrixXd hessian = gram.bottomRightCorner(n, n);
    hessian.diagonal().array() += 1;
    Eigen::VectorXd gradient = gram.bottomLeftCorner(n, 1);
    const Eigen::VectorXd z = z_of(now);
    gradient.head(parameters) += z;
    gradient.tail(extra) += from_start(now.fit.effects);
    const auto solved = [&](const Eigen::MatrixXd& h, const Eigen::VectorXd& g, const Eigen::VectorXd& from) {
      return bounded_move(h, g, from, lowest, residuals.options().linearisation);
    };

    Point tried;
    bool better = false;
    if (closely) {
      const auto halved = [&](const Eigen::VectorXd& move) {
        double fraction = 1;
        for (std::size_t attempt = 0; attempt < options.attempts && !better; ++attempt, fraction /= 2) {
          tried = moved(now, fraction * move);
          better = tried.fit.loss < now.fit.loss;
          for (std::size_t i = 0; i < options.corrections && !better; ++i) {
            const Eigen::MatrixXd there = gram_of(tried);
            Eigen::MatrixXd side = there.bottomRightCorner(n, n);
            side.diagonal().array() += 1;
            tried = moved(tried, solved(side, there.bottomLeftCorner(n, 1), z_of(tried)));
            better = tried.fit.loss < now.fit.loss;
          }
        }
      };
      // What others are uncertain by, where friction holds here and not there, must not keep the fit from its ridge.
      if (ridge) {
        const double slope = gradient.dot(ridge->along), curvature = ridge->along.dot(hessian * ridge->along);
        if (0.5 * slope * slope / curvature > settled) halved(-slope / curvature * ridge->along);
      }
      // Damping would hold what the data say little of. Parameters of which only a product shows lie in a bent valley:
      // a step along its tangent climbs its side, from where the data alone lead back into it.
      const Eigen::VectorXd move = solved(hessian, gradient, z);
      if (!better && -0.5 * gradient.dot(move) < settled) break;
      if (!better) halved(move);
    } else {
      for (std::size_t attempt = 0; attempt < options.attempts && !better; ++attempt) {
        Eigen::MatrixXd damped = hessian;
        damped.diagonal() *= 1 + damping;
        tried = moved(now, solved(damped, gradient, z));
        better = tried.fit.loss < now.fit.loss;
        damping = better ? damping * options.damping_decrease_ratio
                         : std::max(options.damping_first, damping * options.damping_increase_ratio);
      }
    }
    if (!better) break;
    const double gain = now.fit.loss - tried.fit.loss;
    now = std::move(tried);
    if (gain < settled && iteration > 0) break;
  }
  return now.fit;
}

std::vector<Eigen::VectorXd> information(const ResidualModel& residuals, const FitResult& fit,
                                         const Linearisation& linear, int jobs) {
  const Coordinates coordinates = coordinates_of(fit.effects);
  const std::vector<Eigen::MatrixXf> now = residuals_of(residuals, fit.model, linear.runs(), jobs);
  std::vector<Eigen::VectorXd> result(linear.runs().size(),
                                      Eigen::VectorXd::Zero(static_cast<Eigen::Index>(coordinates.size())));
  const auto products = linear.products(now, effect_sensitivity(residuals, fit, coordinates, now, linear, jobs));
  std::size_t segment = 0;
  for (std::size_t r = 0; r < result.size(); ++r)
    for (std::size_t g = 0; g < residuals.runs()[linear.runs()[r]].segments(); ++g, ++segment)
      result[r] += linear.weights()[segment] * products[segment].diagonal().tail(result[r].size());
  return result;
}

double least_own_part(const ResidualModel& residuals, const FitResult& fit, const Linearisation& linear, int jobs) {
  const Coordinates coordinates = coordinates_of(fit.effects);
  const std::vector<Eigen::MatrixXf>& now = linear.at_model();
  const std::vector<Eigen::MatrixXd> products =
      linear.products(now, effect_sensitivity(residuals, fit, coordinates, now, linear, jobs));
  const auto extra = static_cast<Eigen::Index>(coordinates.size()), all = products.front().rows();
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(all, all);
  for (std::size_t g = 0; g < products.size(); ++g) gram += linear.weights()[g] * products[g];
  double least = 1;
  for (Eigen::Index i = all - extra; i < all; ++i) {
    // The others, without the residuals.
    Eigen::MatrixXd among(all - 2, all - 2);
    Eigen::VectorXd across(all - 2);
    for (Eigen::Index a = 1, row = 0; a < all; ++a) {
      if (a == i) continue;
      across[row] = gram(a, i);
      for (Eigen::Index b = 1, column = 0; b < all; ++b)
        if (b != i) among(row, column++) = gram(a, b);
      ++row;
    }
    among.diagonal().array() += kNothing;
    if (gram(i, i) > 0) least = std::min(least, 1 - across.dot(among.ldlt().solve(across)) / gram(i, i));
  }
  return least;
}

Eigen::MatrixXd uncertainty(const ResidualModel& residuals, const FitResult& fit, const Linearisation& linear,
                            int jobs) {
  const Coordinates coordinates = coordinates_of(fit.effects);
  const std::vector<Eigen::MatrixXf>& now = linear.at_model();
  auto columns = effect_sensitivity(residuals, fit, coordinates, now, linear, jobs);
  std::vector<Eigen::MatrixXd> products = linear.products(now, columns);
  if (linear.differences() == Differences::central) {
    const Eigen::Index all = products.front().rows() - 1;
    Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(all, all);
    for (std::size_t g = 0; g < products.size(); ++g)
      gram += linear.weights()[g] * products[g].bottomRightCorner(all, all);
    const Ridge ridge = weakest(gram);
    columns.push_back(response_along(residuals, fit, coordinates, ridge, now, linear, jobs));
    products = linear.products(now, columns);
    for (Eigen::MatrixXd& part : products) part = straightened(part, ridge);
  }
  const Eigen::Index n = products.front().rows() - 1;
  Eigen::MatrixXd hessian = Eigen::MatrixXd::Identity(n, n), gradients(n, static_cast<Eigen::Index>(products.size()));
  for (std::size_t g = 0; g < products.size(); ++g) {
    hessian += linear.weights()[g] * products[g].bottomRightCorner(n, n);
    gradients.col(static_cast<Eigen::Index>(g)) = linear.weights()[g] * products[g].col(0).tail(n);
  }
  // What the segments' gradients scatter about their mean; for white residuals that is the Hessian again. The prior's
  // one is kept.
  gradients.colwise() -= gradients.rowwise().mean().eval();
  const Eigen::MatrixXd scatter = Eigen::MatrixXd::Identity(n, n) + gradients * gradients.transpose();
  const Eigen::MatrixXd inverse = hessian.inverse();
  return inverse * scatter * inverse;
}

}  // namespace faultline
