#include "faultline/segments/grid_step.h"

#include <algorithm>
#include <cmath>

namespace faultline {

double grid_step(std::vector<double> values, double resolution, std::size_t least_levels,
                 const SegmentOptions& options) {
  values.erase(std::remove_if(values.begin(), values.end(), [](double value) { return !std::isfinite(value); }),
               values.end());
  const std::size_t readings = values.size();
  std::vector<double>& levels = values;
  std::sort(levels.begin(), levels.end());
  if (levels.empty()) return 0;
  // A little more than the resolution, for the rounding of a quotient.
  const double close = std::max(
      1.01 * resolution, options.grid_same_fraction * std::max(std::abs(levels.front()), std::abs(levels.back())));
  levels.erase(std::unique(levels.begin(), levels.end(), [&](double a, double b) { return b - a <= close; }),
               levels.end());
  if (levels.size() < std::max<std::size_t>(2, least_levels) || 2 * levels.size() > readings) return 0;
  double smallest = levels[1] - levels[0];
  for (std::size_t i = 2; i < levels.size(); ++i) smallest = std::min(smallest, levels[i] - levels[i - 1]);
  if (smallest <= 2 * close) return 0;
  std::vector<double> counts = {0};
  for (std::size_t i = 1; i < levels.size(); ++i)
    counts.push_back(counts.back() + std::round((levels[i] - levels[i - 1]) / smallest));
  const double step = (levels.back() - levels.front()) / counts.back();
  for (std::size_t i = 0; i < levels.size(); ++i)
    if (std::abs(levels[i] - levels.front() - counts[i] * step) > close) return 0;
  return step;
}

double rounding_noise(double step) { return step / std::sqrt(12.0); }

}  // namespace faultline
