#include "faultline/attribution/fault_hypothesis.h"

#include <algorithm>
#include <cmath>

#include "faultline/attribution/candidates.h"
#include "faultline/rig/effect_unit.h"

namespace faultline {
namespace {

constexpr double kLeastAmplitude = 1e-12;  // so that a size that falls with the amplitude stays finite

double middle(const Bounds& b, const HypothesisOptions& options) {
  return b.minimum > 0 && b.maximum > options.logarithmic_ratio * b.minimum ? std::sqrt(b.minimum * b.maximum)
                                                                            : 0.5 * (b.minimum + b.maximum);
}

bool has_size(const EffectType& type) {
  return type.name != "stuck" && type.name != "noise" && type.name != "quantisation" && !type.parameters.empty();
}

// False where the bounds leave nothing to look for.
bool set_range(FaultHypothesis& h, const Bounds& b, const HypothesisOptions& options) {
  if (std::isinf(h.none)) {
    if (!(b.minimum > 0) || !std::isfinite(b.minimum)) return false;
    const double full = std::isfinite(b.maximum) ? std::sqrt(b.minimum * b.maximum) : options.open_ratio * b.minimum;
    h.full.parameters[h.parameter] = full;
    h.highest = full / b.minimum;
    h.lowest = options.least_amplitude_ratio * h.highest;
    h.probe = 1;
    return true;
  }
  const double below = h.none - b.minimum, above = b.maximum - h.none;
  if (!std::isfinite(below) || !std::isfinite(above)) return false;
  if (below > 0 && above > 0) {
    const double reach = std::max(below, above);
    h.full.parameters[h.parameter] = h.none + (above >= below ? reach : -reach);
    h.lowest = above >= below ? -below / reach : -above / reach;
    h.highest = 1;
    h.probe = options.small_amplitude;
    return true;
  }
  const double near = above > 0 ? std::max(b.minimum - h.none, 0.0) : std::max(h.none - b.maximum, 0.0);
  const double far = above > 0 ? above : below;
  if (!(far > 0)) return false;
  const double reach = near > 0 && far > options.logarithmic_ratio * near ? std::sqrt(near * far) : 0.5 * far;
  h.full.parameters[h.parameter] = h.none + (above > 0 ? reach : -reach);
  h.lowest = 0;
  h.highest = far / reach;
  h.probe = 1;
  return true;
}

}  // namespace

double effect_size(double none, double full, double amplitude) {
  if (std::isinf(none)) return full / std::max(amplitude, kLeastAmplitude);
  return none + amplitude * (full - none);
}

std::vector<double> scaled(const EffectSpec& full, double amplitude) {
  const EffectType& type = *find_effect_type(full.effect);
  std::vector<double> values = full.parameters;
  for (std::size_t p = 0; p < values.size(); ++p)
    if (!is_shape(type.parameters[p])) values[p] = effect_size(type.parameters[p].none, values[p], amplitude);
  return values;
}

EffectSpec FaultHypothesis::at(double amplitude) const {
  EffectSpec spec = full;
  spec.parameters[parameter] = size(amplitude);
  return spec;
}

double FaultHypothesis::size(double amplitude) const {
  return effect_size(none, full.parameters[parameter], amplitude);
}

std::vector<FaultHypothesis> fault_hypotheses(const Datasheet& sheet, const HypothesisOptions& options) {
  std::vector<FaultHypothesis> result;
  for (const Candidate& candidate : candidates(sheet, {}, kInfinity)) {
    const EffectType& type = *find_effect_type(candidate.effect.effect);
    if (!has_size(type)) continue;
    const Port& port = sheet.port(candidate.effect.port);
    for (std::size_t p = 0; p < type.parameters.size(); ++p) {
      const Bounds& bounds = candidate.bounds[p];
      if (is_shape(type.parameters[p]) || bounds.minimum >= bounds.maximum) continue;
      FaultHypothesis h;
      h.effect = type.name;
      h.port = port.name;
      h.family = candidate.family;
      h.kind = port.kind == PortKind::sensor ? AlarmKind::sensor : AlarmKind::fault;
      h.parameter = p;
      h.size_name = type.parameters[p].name;
      h.size_unit = parameter_unit(sheet, port, type, type.parameters[p]);
      h.none = type.parameters[p].none;
      h.full = candidate.effect;
      for (std::size_t other = 0; other < type.parameters.size(); ++other)
        if (is_shape(type.parameters[other])) h.full.parameters[other] = middle(candidate.bounds[other], options);
      if (set_range(h, bounds, options)) result.push_back(h);
    }
  }
  return result;
}

}  // namespace faultline
