#include "faultline/rig/effect_chain.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kTransitionShare = 1e-3;  // of a port's range

bool grows(const EffectSpec& spec) { return spec.from_given || spec.to > spec.from; }

// Seeds of neighbouring effects must not be neighbours (splitmix64, Steele, Lea and Flood 2014).
std::uint64_t seed_of(std::uint64_t seed, std::size_t index) {
  std::uint64_t mixed = seed + (static_cast<std::uint64_t>(index) + 1) * 0x9E3779B97F4A7C15ULL;
  mixed = (mixed ^ (mixed >> 30)) * 0xBF58476D1CE4E5B9ULL;
  mixed = (mixed ^ (mixed >> 27)) * 0x94D049BB133111EBULL;
  return mixed ^ (mixed >> 31);
}

const Port* find_port(const Datasheet& sheet, const std::string& name) {
  const auto found =
      std::find_if(sheet.ports.begin(), sheet.ports.end(), [&](const Port& p) { return p.name == name; });
  return found == sheet.ports.end() ? nullptr : &*found;
}

PortContext context_of(const Datasheet& sheet, const Port& port, const EffectSpec& spec, double step, double input_step,
                       std::uint64_t seed) {
  PortContext context;
  context.range = port.range;
  context.step = step;
  context.seed = seed;
  context.only_scaled =
      port.kind == PortKind::heat && std::none_of(port.effects.begin(), port.effects.end(), [](const FittingEffect& e) {
        return e.effect == "heat_loss" || e.effect == "heat_capacity";
      });
  if (!port.drop_unit.empty()) context.transition = kTransitionShare * port.range;
  if (grows(spec)) context.start = spec.from;
  const int channel = port.channel.empty() ? -1 : find_channel(sheet.channels, port.channel);
  if (channel >= 0) {
    const Channel& passes = sheet.channels[static_cast<std::size_t>(channel)];
    context.noise_std = passes.noise_std;
    if (port.kind == PortKind::sensor && passes.role == Role::input && input_step > 0) context.step = input_step;
  }
  return context;
}

bool changes_nothing(const EffectType& type, const EffectSpec& spec) {
  for (std::size_t p = 0; p < type.parameters.size(); ++p)
    if (!std::isnan(type.parameters[p].none) && spec.parameters[p] != type.parameters[p].none) return false;
  return true;
}

}  // namespace

EffectSet::EffectSet(const Datasheet& sheet, const std::vector<EffectSpec>& specs, double step, std::uint64_t seed,
                     double input_step)
    : asked_(sheet.asked) {
  for (std::size_t i = 0; i < specs.size(); ++i) {
    const EffectSpec& spec = specs[i];
    check_effect(sheet, spec);
    const EffectType& type = *find_effect_type(spec.effect);
    // An effect that changes nothing is left out, so that a rig need not carry its states (a second body, a hose).
    if (changes_nothing(type, spec)) continue;
    specs_.push_back(spec);
    std::vector<double> none;
    for (const auto& p : type.parameters) none.push_back(p.none);
    effects_.push_back(type.make());
    effects_.back()->configure(
        spec.parameters, none,
        context_of(sheet, *find_port(sheet, spec.port), spec, step, input_step, seed_of(seed, i)));
    chains_[spec.port].add(effects_.back().get());
  }
  reset();
}

const EffectChain& EffectSet::at(const std::string& port) const {
  if (asked_) asked_->insert("ports." + port);
  const auto found = chains_.find(port);
  return found == chains_.end() ? none_ : found->second;
}

void EffectSet::set_time(double time) {
  for (std::size_t i = 0; i < specs_.size(); ++i) {
    if (!grows(specs_[i])) continue;
    const double size = growth(specs_[i], time);
    if (size != effects_[i]->size()) effects_[i]->set_size(size);
  }
}

bool EffectSet::remembers() const {
  return std::any_of(effects_.begin(), effects_.end(), [](const auto& e) { return e->remembers(); });
}

bool EffectSet::remembers_inside() const {
  for (std::size_t i = 0; i < specs_.size(); ++i) {
    const PortKind kind = port_kind(specs_[i].port);
    if (effects_[i]->remembers() && kind != PortKind::command && kind != PortKind::sensor) return true;
  }
  return false;
}

void EffectSet::reset() {
  set_time(0);
  for (const auto& effect : effects_) effect->reset();
}

void check_effect(const Datasheet& sheet, const EffectSpec& spec) {
  const EffectType* type = find_effect_type(spec.effect);
  if (!type)
    throw InputError(fmt::format("effect '{}@{}': there is no effect '{}'; `faultline rigs` lists them", spec.effect,
                                 spec.port, spec.effect));
  const Port* port = find_port(sheet, spec.port);
  if (!port) {
    std::string names;
    for (const auto& p : sheet.ports) names += (names.empty() ? "" : ", ") + p.name;
    throw InputError(fmt::format("effect '{}@{}': {} has no port '{}'; it has {}", spec.effect, spec.port, sheet.rig,
                                 spec.port, names));
  }
  // What is free is no effect that a rig is said to have: it fits wherever its kind does.
  const bool listed = type->family == "free" ||
                      std::any_of(port->effects.begin(), port->effects.end(),
                                  [&](const FittingEffect& fitting) { return fitting.effect == spec.effect; });
  if (!listed || !type->fits_kind(port->kind)) {
    std::string names;
    for (const auto& fitting : port->effects) names += (names.empty() ? "" : ", ") + fitting.effect;
    throw InputError(fmt::format("effect '{}@{}': {} does not fit {} of {}; there fit {}", spec.effect, spec.port,
                                 spec.effect, spec.port, sheet.rig, names));
  }
  if (spec.parameters.size() != type->parameters.size())
    throw InputError(fmt::format("effect '{}@{}': {} parameters given, it has {}", spec.effect, spec.port,
                                 spec.parameters.size(), type->parameters.size()));
}

}  // namespace faultline
