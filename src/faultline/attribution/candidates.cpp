#include "faultline/attribution/candidates.h"

#include <algorithm>
#include <cmath>

namespace faultline {

bool Candidate::logarithmic(std::size_t i) const {
  return bounds[i].minimum > 0 && bounds[i].maximum / bounds[i].minimum > logarithmic_ratio;
}

double Candidate::to_coordinate(std::size_t i, double value) const {
  const Bounds& b = bounds[i];
  if (logarithmic(i)) return std::log(std::max(value, 1e-300) / b.minimum) / std::log(b.maximum / b.minimum);
  return (value - b.minimum) / (b.maximum - b.minimum);
}

double Candidate::from_coordinate(std::size_t i, double coordinate) const {
  const Bounds& b = bounds[i];
  const double c = std::clamp(coordinate, 0.0, 1.0);
  if (logarithmic(i)) return b.minimum * std::pow(b.maximum / b.minimum, c);
  return b.minimum + c * (b.maximum - b.minimum);
}

bool same_effect(const Candidate& a, const Candidate& b) {
  return a.effect.effect == b.effect.effect && a.effect.port == b.effect.port;
}

std::vector<Candidate> candidates(const Datasheet& sheet, const std::vector<std::string>& without, double duration,
                                  const CandidateOptions& options) {
  std::vector<Candidate> result;
  for (const Port& port : sheet.ports)
    for (const FittingEffect& fitting : port.effects) {
      const EffectType* type = find_effect_type(fitting.effect);
      if (!type) continue;
      const std::string whole = fitting.effect + "@" + port.name;
      if (std::any_of(without.begin(), without.end(),
                      [&](const std::string& w) { return w == whole || w == fitting.effect; }))
        continue;
      Candidate candidate;
      candidate.effect.effect = fitting.effect;
      candidate.effect.port = port.name;
      candidate.family = type->family;
      candidate.logarithmic_ratio = options.logarithmic_ratio;
      for (const EffectParameter& parameter : type->parameters) {
        const auto found = fitting.bounds.find(parameter.name);
        // A parameter without a range here keeps its no-effect or usual value.
        const double kept = not_given(parameter);
        Bounds bounds = found == fitting.bounds.end() ? Bounds{kept, kept} : found->second;
        if (!std::isfinite(bounds.maximum)) bounds.maximum = duration;  // "from" of a stuck sensor: any time of the run
        candidate.bounds.push_back(bounds);
        candidate.effect.parameters.push_back(parameter.none);
      }
      result.push_back(candidate);
    }
  return result;
}

std::vector<Candidate> with_open_shapes(std::vector<Candidate> all) {
  for (Candidate& candidate : all) {
    const auto& parameters = find_effect_type(candidate.effect.effect)->parameters;
    for (std::size_t p = 0; p < parameters.size(); ++p)
      if (Bounds& b = candidate.bounds[p]; std::isfinite(parameters[p].usual) && b.minimum >= b.maximum)
        b = {parameters[p].minimum, parameters[p].maximum};
  }
  return all;
}

std::vector<std::vector<double>> starting_points(const Candidate& candidate, const CandidateOptions& options) {
  if (!candidate.starts.empty()) return candidate.starts;
  // Sizes over the range on both sides of no effect; a second parameter is a shape and gets three values, but one where
  // it has a usual value that is no angle.
  const EffectType* type = find_effect_type(candidate.effect.effect);
  std::vector<std::vector<double>> points = {{}};
  for (std::size_t i = 0; i < candidate.bounds.size(); ++i) {
    const Bounds& b = candidate.bounds[i];
    const double none = type->parameters[i].none;
    std::vector<double> values;
    if (b.minimum >= b.maximum) {
      values = {b.minimum};
    } else if (i == type->with_unit("rad")) {  // an angle: four, so that each third trial sees all of them
      for (const double c : {0.125, 0.375, 0.625, 0.875}) values.push_back(candidate.from_coordinate(i, c));
    } else if (std::isfinite(type->parameters[i].usual)) {
      values = {candidate.from_coordinate(i, 0.5)};
    } else if (i > 0 || std::isnan(none)) {
      for (const double c : options.shape_coordinates) values.push_back(candidate.from_coordinate(i, c));
      const double nothing = std::clamp(none, b.minimum, b.maximum);
      if (i > 0 && !std::isnan(none) && std::find(values.begin(), values.end(), nothing) == values.end())
        values.push_back(nothing);
    } else if (candidate.family == "stuck") {  // a time: its loss has a narrow valley
      const double times = static_cast<double>(options.stuck_times);
      for (std::size_t k = 0; k < options.stuck_times; ++k)
        values.push_back(candidate.from_coordinate(i, (static_cast<double>(k) + 0.5) / times));
    } else if (candidate.logarithmic(i) || std::isinf(none)) {
      for (const double c : options.logarithmic_coordinates) values.push_back(candidate.from_coordinate(i, c));
    } else {
      for (const double fraction : options.size_fractions) {
        if (b.minimum < none) values.push_back(none + fraction * (b.minimum - none));
        if (b.maximum > none) values.push_back(none + fraction * (b.maximum - none));
      }
    }
    std::vector<std::vector<double>> grown;
    for (const auto& point : points)
      for (const double value : values) {
        grown.push_back(point);
        grown.back().push_back(value);
      }
    points = std::move(grown);
  }
  return points;
}

}  // namespace faultline
