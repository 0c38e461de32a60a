#include "faultline/gap/grid_step.h"

#include <algorithm>
#include <cmath>

#include "faultline/attribution/candidates.h"

namespace faultline {

double grid_step(const Recording& recording, std::size_t column, double resolution, const GapOptions::Grid& options) {
  std::vector<double> levels;
  for (std::size_t k = 0; k < recording.rows(); ++k)
    if (const double value = recording.at(k, column); std::isfinite(value)) levels.push_back(value);
  if (levels.empty()) return 0;
  std::sort(levels.begin(), levels.end());
  // A little more than the resolution, for the rounding of a quotient.
  const double close =
      std::max(1.01 * resolution, options.same_fraction * std::max(std::abs(levels.front()), std::abs(levels.back())));
  levels.erase(std::unique(levels.begin(), levels.end(), [&](double a, double b) { return b - a <= close; }),
               levels.end());
  if (levels.size() < options.least_levels || 2 * levels.size() > recording.rows()) return 0;
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

std::vector<NamedEffect> rounded_channels(const ResidualModel& model, const std::vector<std::string>& without) {
  const Datasheet& sheet = model.sheet();
  const std::vector<SegmentedRun>& runs = model.runs();
  const GapOptions::Grid& options = model.options().grid;
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
    for (const SegmentedRun& run : runs) {
      const double step = grid_step(run.recording, column, channel.resolution, options);
      least = &run == &runs.front() ? step : std::min(least, step);
      most = std::max(most, step);
    }
    const double half_width = options.half_width_fraction;
    if (least <= 2 * channel.resolution || most > (1 + half_width) * least) continue;
    const auto output = std::find(model.outputs().begin(), model.outputs().end(), static_cast<int>(column));
    if (output == model.outputs().end()) continue;
    const double noise =
        std::max(channel.noise_std, model.noise()[static_cast<std::size_t>(output - model.outputs().begin())]);
    if (least * least / 12 < options.least_noise_fraction * noise * noise) continue;
    NamedEffect effect;
    effect.effect = candidate.effect.effect;
    effect.port = candidate.effect.port;
    effect.family = candidate.family;
    effect.parameters["step"] = least;
    effect.intervals["step"] = {(1 - half_width) * least, (1 + half_width) * least};
    effect.probability = 1;
    result.push_back(effect);
  }
  return result;
}

}  // namespace faultline
