#include "faultline/isolation/balance_model.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace faultline {
namespace {

constexpr double kStep = 0.1;  // of the change that a hypothesis names for differences: balances are nearly linear
constexpr double kReach = 10;  // times the datasheet's range: no rival is left out because it would have to be large
constexpr double kFurthest = 0.9;  // of what the effect itself allows, whose ends are no rig any more (all clogged)

}  // namespace

std::optional<Hypothesis> listed(const std::vector<FaultHypothesis>& all, const std::string& name, std::string text) {
  const auto found = std::find_if(all.begin(), all.end(), [&](const FaultHypothesis& h) { return h.name() == name; });
  if (found == all.end() || !std::isfinite(found->none)) return {};
  Hypothesis h;
  h.kind = found->kind;
  h.effect = found->effect;
  h.port = found->port;
  h.text = std::move(text);
  h.size_name = found->size_name;
  h.size_unit = found->size_unit;
  h.shown_from = found->none;
  h.unit = kStep * std::abs(found->size(found->probe) - found->none);
  const EffectParameter& size = find_effect_type(h.effect)->parameters[found->parameter];
  const double one = found->size(found->lowest) - found->none, other = found->size(found->highest) - found->none;
  h.low = std::max(kReach * std::min(one, other), kFurthest * (size.minimum - found->none));
  h.high = std::min(kReach * std::max(one, other), kFurthest * (size.maximum - found->none));
  return h;
}

}  // namespace faultline
