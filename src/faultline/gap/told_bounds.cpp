#include "faultline/gap/told_bounds.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "faultline/rig/parameter_range.h"

namespace faultline {
namespace {

// Parameters that lie as far from the datasheet as they may.
std::vector<std::string> at_bounds(const Datasheet& sheet, const std::vector<double>& parameters,
                                   const GapOptions& options) {
  std::vector<std::string> names;
  const double highest = options.linearisation.parameter_bound_tolerances;
  for (std::size_t i = 0; i < sheet.parameters.size(); ++i) {
    const Parameter& p = sheet.parameters[i];
    if (p.tolerance <= 0) continue;
    const double z = (parameters[i] - p.nominal) / (p.nominal * p.tolerance);
    if (z >= 0.999 * highest || z <= 0.999 * lowest_deviation(p, highest)) names.push_back(p.name);
  }
  return names;
}

std::vector<double> parameters_of(const Datasheet& sheet, const GapLevel& level) {
  std::vector<double> parameters = sheet.nominal();
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const auto factor = level.parameters.find(sheet.parameters[i].name);
    if (factor != level.parameters.end()) parameters[i] *= factor->second;
  }
  return parameters;
}

struct BeyondRange {
  std::size_t parameter;
  Bounds range;
};

// Parameters of an effect that lie beyond the datasheet's ranges; a time is no size.
std::vector<BeyondRange> sizes_beyond(const Datasheet& sheet, const Candidate& candidate) {
  std::vector<BeyondRange> result;
  const EffectType* type = find_effect_type(candidate.effect.effect);
  for (const FittingEffect& fitting : sheet.port(candidate.effect.port).effects) {
    if (fitting.effect != candidate.effect.effect || type->family == "stuck") continue;
    for (std::size_t p = 0; p < candidate.bounds.size(); ++p) {
      const auto range = fitting.bounds.find(type->parameters[p].name);
      const double value = candidate.effect.parameters[p];
      if (range != fitting.bounds.end() && (value < range->second.minimum || value > range->second.maximum))
        result.push_back({p, range->second});
    }
  }
  return result;
}

}  // namespace

std::vector<std::string> at_bounds(const Datasheet& sheet, const GapLevel& level, const GapOptions& options) {
  return at_bounds(sheet, parameters_of(sheet, level), options);
}

double prior_loss(const Datasheet& sheet, const GapLevel& level) {
  const std::vector<double> parameters = parameters_of(sheet, level);
  double loss = 0;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const Parameter& p = sheet.parameters[i];
    if (p.tolerance > 0) loss += 0.5 * std::pow((parameters[i] / p.nominal - 1) / p.tolerance, 2);
  }
  return loss;
}

std::string told_at_bounds(const Datasheet& sheet, const ModelChange& model, const GapOptions& options) {
  const std::vector<std::string> names = at_bounds(sheet, model.parameters, options);
  if (names.empty()) return {};
  const bool several = names.size() > 1;
  return fmt::format(
      "{} {} as far from the datasheet as {} may go, at most {:.2g} tolerances: correct the datasheet or its "
      "tolerance, unless what the model lacks bends {}",
      fmt::join(names, ", "), several ? "lie" : "lies", several ? "they" : "it",
      options.linearisation.parameter_bound_tolerances, several ? "them" : "it");
}

bool beyond_range(const Datasheet& sheet, const Candidate& candidate) {
  return !sizes_beyond(sheet, candidate).empty();
}

bool at_farthest(const Datasheet& sheet, const Candidate& candidate, const GapOptions& options) {
  const std::vector<BeyondRange> beyond = sizes_beyond(sheet, candidate);
  return std::any_of(beyond.begin(), beyond.end(), [&](const BeyondRange& size) {
    const double place = candidate.to_coordinate(size.parameter, candidate.effect.parameters[size.parameter]);
    return std::abs(place - 0.5) > 0.5 - options.verdict.bound_coordinate;
  });
}

std::string told_beyond_range(const Datasheet& sheet, const std::vector<Candidate>& effects) {
  std::string text;
  for (const Candidate& c : effects)
    for (const auto& [p, range] : sizes_beyond(sheet, c))
      text += fmt::format("{}{} of {}@{} ({:.4g}) lies beyond the datasheet's range, {:.4g} to {:.4g}",
                          text.empty() ? "" : "; ", find_effect_type(c.effect.effect)->parameters[p].name,
                          c.effect.effect, c.effect.port, c.effect.parameters[p], range.minimum, range.maximum);
  return text;
}

}  // namespace faultline
