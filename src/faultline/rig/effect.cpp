#include "faultline/rig/effect.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <set>

#include <fmt/format.h>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr int kMostSwells = 1000;

double parse_number(const std::string& text, const std::string& key, const std::string& whole) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (text.empty() || end != text.c_str() + text.size() || std::isnan(value))
    throw InputError(fmt::format("effect '{}': {}={} is not a number; write it like {}=0.5", whole, key, text, key));
  return value;
}

std::string parameter_names(const EffectType& type) {
  std::string names;
  for (const auto& p : type.parameters) names += (names.empty() ? "" : ", ") + p.name;
  return names;
}

}  // namespace

bool is_shape(const EffectParameter& parameter) { return std::isnan(parameter.none); }

double not_given(const EffectParameter& parameter) { return is_shape(parameter) ? parameter.usual : parameter.none; }

void Effect::configure(const std::vector<double>& parameters, const std::vector<double>& none,
                       const PortContext& context) {
  std::copy_n(parameters.begin(), std::min<std::size_t>(parameters.size(), kMaximumEffectParameters), full_.begin());
  std::copy_n(none.begin(), std::min<std::size_t>(none.size(), kMaximumEffectParameters), none_.begin());
  context_ = context;
  set_size(1);
  reset();
}

void Effect::set_size(double size) {
  size_ = size;
  for (std::size_t i = 0; i < now_.size(); ++i) {
    if (size >= 1 || std::isnan(none_[i]))
      now_[i] = full_[i];
    else if (std::isinf(none_[i]))
      now_[i] = size > 0 ? full_[i] / size : none_[i];
    else
      now_[i] = none_[i] + size * (full_[i] - none_[i]);
  }
  parameters_changed();
}

Shown Effect::undo(const Course& out, double later, double time, double /*own*/) const {
  const Shown shown = out(later);
  const double at = time + later, step = context_.step;
  Shown in = shown;
  in.value = undo_signal(shown.value, at);
  const double slope = (undo_signal(shown.value + step * shown.slope, at + step) - in.value) / step;
  if (std::isfinite(slope)) in.slope = slope;
  return in;
}

bool EffectType::fits_kind(PortKind kind) const { return std::find(fits.begin(), fits.end(), kind) != fits.end(); }

int EffectType::parameter_index(const std::string& wanted) const {
  for (std::size_t i = 0; i < parameters.size(); ++i)
    if (parameters[i].name == wanted) return static_cast<int>(i);
  return -1;
}

std::size_t EffectType::with_unit(const std::string& unit) const {
  const auto found = std::find_if(parameters.begin(), parameters.end(),
                                  [&](const EffectParameter& parameter) { return parameter.unit == unit; });
  return static_cast<std::size_t>(found - parameters.begin());
}

EffectSpec parse_effect(const std::string& text) {
  EffectSpec spec;
  const auto at = text.find('@');
  const auto colon = text.find(':', at == std::string::npos ? 0 : at);
  if (at == std::string::npos || at == 0)
    throw InputError(fmt::format(
        "effect '{}': write effect@port:name=value,..., as in coulomb_friction@force.BODY:force=100", text));
  spec.effect = text.substr(0, at);
  spec.port = text.substr(at + 1, colon == std::string::npos ? std::string::npos : colon - at - 1);
  const EffectType* type = &registry<EffectType>().require(spec.effect, fmt::format("effect '{}'", text));
  if (!type->fits_kind(port_kind(spec.port)))
    throw InputError(
        fmt::format("effect '{}': {} does not fit a {} port", text, spec.effect, to_string(port_kind(spec.port))));

  std::vector<bool> given(type->parameters.size(), false);
  for (const auto& p : type->parameters) spec.parameters.push_back(not_given(p));
  std::set<std::string> keys;
  std::size_t begin = colon == std::string::npos ? text.size() : colon + 1;
  while (begin < text.size()) {
    const auto comma = std::min(text.find(',', begin), text.size());
    const std::string item = text.substr(begin, comma - begin);
    begin = comma + 1;
    const auto equals = item.find('=');
    const std::string key = item.substr(0, equals);
    const double value = parse_number(equals == std::string::npos ? "" : item.substr(equals + 1), key, text);
    const int index = type->parameter_index(key);
    if (!keys.insert(key).second) throw InputError(fmt::format("effect '{}': {} is given twice; keep one", text, key));
    if (index >= 0) {
      const auto& p = type->parameters[static_cast<std::size_t>(index)];
      if (value != p.none && (value < p.minimum || value > p.maximum))
        throw InputError(
            fmt::format("effect '{}': {}={} is outside {}..{} {}", text, key, value, p.minimum, p.maximum, p.unit));
      spec.parameters[static_cast<std::size_t>(index)] = value;
      given[static_cast<std::size_t>(index)] = true;
    } else if ((key == "from" || key == "to") && std::isinf(value)) {
      throw InputError(fmt::format("effect '{}': {}={} is not a time; give seconds from the start", text, key, value));
    } else if (key == "from") {
      spec.from = value;
      spec.from_given = true;
    } else if (key == "to") {
      spec.to = value;
    } else if (key == "swells") {
      if (!(value >= 1 && value <= kMostSwells) || value != std::floor(value))
        throw InputError(
            fmt::format("effect '{}': swells={} is not a whole number of 1 to {}", text, value, kMostSwells));
      spec.swells = static_cast<int>(value);
    } else {
      throw InputError(fmt::format("effect '{}': {} has no parameter '{}'; it has {}, and from, to in s, swells", text,
                                   spec.effect, key, parameter_names(*type)));
    }
  }
  for (std::size_t i = 0; i < given.size(); ++i)
    if (std::isnan(spec.parameters[i]))
      throw InputError(fmt::format("effect '{}': parameter '{}' [{}] is missing", text, type->parameters[i].name,
                                   type->parameters[i].unit));
  bool sized = false;  // a shape that has a usual value says nothing of the size
  for (std::size_t i = 0; i < given.size(); ++i) sized |= given[i] && std::isnan(type->parameters[i].usual);
  if (!sized) throw InputError(fmt::format("effect '{}': give a size: {}", text, parameter_names(*type)));
  if (keys.count("to") == 0) spec.to = spec.from;
  if (spec.to < spec.from)
    throw InputError(fmt::format("effect '{}': to={} is before from={}; give to after from, or leave it out for a step",
                                 text, spec.to, spec.from));
  if (spec.swells > 0 && (!spec.from_given || spec.to <= spec.from))
    throw InputError(fmt::format("effect '{}': swells need a time to fill; give from=S,to=S with to above from", text));
  return spec;
}

std::string to_string(const EffectSpec& spec) {
  std::string text = spec.effect + "@" + spec.port;
  const EffectType* type = find_effect_type(spec.effect);
  char separator = ':';
  for (std::size_t i = 0; type && i < spec.parameters.size(); ++i) {
    text += fmt::format("{}{}={:.6g}", separator, type->parameters[i].name, spec.parameters[i]);
    separator = ',';
  }
  if (spec.from_given) text += fmt::format("{}from={:.6g}", separator, spec.from);
  if (spec.to > spec.from) text += fmt::format(",to={:.6g}", spec.to);
  if (spec.swells > 0) text += fmt::format(",swells={}", spec.swells);
  return text;
}

double growth(const EffectSpec& spec, double time) {
  if (!spec.from_given && spec.to <= spec.from) return 1;
  if (time < spec.from) return 0;
  if (spec.swells > 0 && spec.to > spec.from) {
    const double share = (time - spec.from) / (spec.to - spec.from);
    return share < 1 ? 0.5 * (1 - std::cos(2 * kPi * spec.swells * share)) : 0;
  }
  if (time >= spec.to) return 1;
  return (time - spec.from) / (spec.to - spec.from);
}

}  // namespace faultline
