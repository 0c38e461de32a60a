#include "faultline/estimators/fault_hypothesis.h"

#include <algorithm>
#include <cmath>

#include "faultline/estimators/estimate.h"
#include "faultline/rig/effect_unit.h"

namespace faultline {
namespace {

bool is_shape(const EffectParameter& p) { return std::isnan(p.none); }

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
  for (const Port& port : sheet.ports)
    for (const FittingEffect& fitting : port.effects) {
      const EffectType* type = find_effect_type(fitting.effect);
      if (!type || !has_size(*type)) continue;
      for (std::size_t p = 0; p < type->parameters.size(); ++p) {
        const auto bounds = fitting.bounds.find(type->parameters[p].name);
        if (is_shape(type->parameters[p]) || bounds == fitting.bounds.end()) continue;
        FaultHypothesis h;
        h.effect = type->name;
        h.port = port.name;
        h.family = type->family;
        h.kind = port.kind == PortKind::sensor ? AlarmKind::sensor : AlarmKind::fault;
        h.parameter = p;
        h.size_name = type->parameters[p].name;
        h.size_unit = effect_unit(sheet, port, type->parameters[p].unit);
        h.none = type->parameters[p].none;
        h.full.effect = type->name;
        h.full.port = port.name;
        for (const EffectParameter& other : type->parameters) {
          const auto range = fitting.bounds.find(other.name);
          h.full.parameters.push_back(!is_shape(other)                ? other.none
                                      : range != fitting.bounds.end() ? middle(range->second, options)
                                                                      : other.minimum);
        }
        if (set_range(h, bounds->second, options)) result.push_back(h);
      }
    }
  return result;
}

}  // namespace faultline
