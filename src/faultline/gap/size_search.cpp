#include "faultline/gap/size_search.h"

#include <algorithm>
#include <limits>

namespace faultline {
namespace {

constexpr double kGolden = 0.6180339887498949;

}  // namespace

double narrow(const std::function<double(double)>& f, double low, double high, std::size_t points, double width) {
  const double spacing = (high - low) / (static_cast<double>(points) - 1);
  double best = std::numeric_limits<double>::infinity(), at = low;
  for (std::size_t i = 0; i < points; ++i) {
    const double tried = low + static_cast<double>(i) * spacing, value = f(tried);
    if (value < best) best = value, at = tried;
  }
  const double floor = low, ceiling = high;
  low = std::max(floor, at - spacing), high = std::min(ceiling, at + spacing);
  double left = high - kGolden * (high - low), right = low + kGolden * (high - low);
  double of_left = f(left), of_right = f(right);
  while (high - low > width) {
    if (of_left < of_right) {
      high = right, right = left, of_right = of_left;
      of_left = f(left = high - kGolden * (high - low));
    } else {
      low = left, left = right, of_left = of_right;
      of_right = f(right = low + kGolden * (high - low));
    }
  }
  const double middle = of_left < of_right ? left : right;
  return std::min(of_left, of_right) < best ? middle : at;
}

double search_effect(const ResidualModel& model, const Linearisation& linear, FitResult& fit, double span,
                     std::size_t points, int jobs) {
  const Datasheet& sheet = model.sheet();
  Candidate& effect = fit.effects.back();
  const Eigen::VectorXd z = deviations(sheet, linear.free_parameters(), fit.model.parameters);
  Adjusted now;
  const auto loss = [&] {
    const ModelChange at = with_effects(fit.effects, fit.model.parameters);
    now = adjusted(linear, linear.products(residuals_of(model, at, linear.runs(), jobs)), z);
    return now.loss;
  };
  const double before = loss();
  double best = before;
  Eigen::VectorXd best_move = now.move;
  for (std::size_t p = 0; p < effect.bounds.size(); ++p) {
    double& value = effect.effect.parameters[p];
    if (effect.bounds[p].minimum >= effect.bounds[p].maximum) continue;
    const double start = value, c = effect.to_coordinate(p, value);
    const auto at = [&](double coordinate) {
      value = effect.from_coordinate(p, coordinate);
      return loss();
    };
    const double found =
        narrow(at, std::max(0.0, c - span), std::min(1.0, c + span), points, span / static_cast<double>(points));
    if (at(found) < best) {
      best = now.loss;
      best_move = now.move;
    } else {
      value = start;
    }
  }
  if (best >= before) return 0;
  shift_parameters(model, linear.free_parameters(), best_move, fit.model.parameters);
  fit.model = with_effects(fit.effects, fit.model.parameters);
  return before - best;
}

}  // namespace faultline
