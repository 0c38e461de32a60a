#include "faultline/gap/rounded_channels.h"

#include <algorithm>
#include <cmath>

#include "faultline/attribution/candidates.h"
#include "faultline/segments/grid_step.h"

namespace faultline {

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
      std::vector<double> readings(run.recording.rows());
      for (std::size_t k = 0; k < readings.size(); ++k) readings[k] = run.recording.at(k, column);
      const double step =
          grid_step(std::move(readings), channel.resolution, options.least_levels, model.options().segments);
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
