#include "faultline/gap/grid_step.h"

#include <algorithm>
#include <cmath>

#include "faultline/gap/candidates.h"

namespace faultline {
namespace {

constexpr std::size_t kLeastLevels = 8;  // fewer say nothing
constexpr double kSame = 1e-9;           // of the largest value: equal but for the digits of a file
constexpr double kHalfWidth = 1e-3;      // half width of the interval of a step, as a share of it

}  // namespace

double grid_step(const Recording& recording, std::size_t column, double resolution) {
  std::vector<double> levels;
  for (std::size_t k = 0; k < recording.rows(); ++k) levels.push_back(recording.at(k, column));
  if (levels.empty()) return 0;
  std::sort(levels.begin(), levels.end());
  const double close = std::max(1.01 * resolution, kSame * std::max(std::abs(levels.front()), std::abs(levels.back())));
  levels.erase(std::unique(levels.begin(), levels.end(), [&](double a, double b) { return b - a <= close; }),
               levels.end());
  if (levels.size() < kLeastLevels || 2 * levels.size() > recording.rows()) return 0;
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

std::vector<NamedEffect> rounded_channels(const Datasheet& sheet, const std::vector<GapRun>& runs,
                                          const std::vector<std::string>& without) {
  std::vector<NamedEffect> result;
  for (const Candidate& candidate : candidates(sheet, without)) {
    if (candidate.effect.effect != "quantisation" || sheet.port(candidate.effect.port).kind != PortKind::sensor)
      continue;
    const bool adopted = std::any_of(sheet.nominal_effects.begin(), sheet.nominal_effects.end(), [&](const auto& text) {
      const EffectSpec spec = parse_effect(text);
      return spec.effect == candidate.effect.effect && spec.port == candidate.effect.port;
    });
    const auto column = static_cast<std::size_t>(sheet.channel(sheet.port(candidate.effect.port).channel));
    const Channel& channel = sheet.channels[column];
    if (adopted || channel.role != Role::output || channel.ground_truth) continue;
    double least = 0, most = 0;
    for (const GapRun& run : runs) {
      const double step = grid_step(run.recording, column, channel.resolution);
      least = &run == &runs.front() ? step : std::min(least, step);
      most = std::max(most, step);
    }
    if (least <= std::max(2 * channel.resolution, channel.noise_std) || most > (1 + kHalfWidth) * least) continue;
    NamedEffect effect;
    effect.effect = candidate.effect.effect;
    effect.port = candidate.effect.port;
    effect.family = candidate.family;
    effect.parameters["step"] = least;
    effect.intervals["step"] = {(1 - kHalfWidth) * least, (1 + kHalfWidth) * least};
    effect.probability = 1;
    result.push_back(effect);
  }
  return result;
}

}  // namespace faultline
