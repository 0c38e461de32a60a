#include "faultline/rig/effect_unit.h"

#include <algorithm>

namespace faultline {
namespace {

bool has_state(const Datasheet& sheet, const std::string& unit) {
  return std::any_of(sheet.states.begin(), sheet.states.end(), [&](const State& s) { return s.unit == unit; });
}

std::string replaced(std::string text, const std::string& from, const std::string& by) {
  const std::size_t at = text.find(from);
  return at == std::string::npos ? text : text.replace(at, from.size(), by);
}

// "m^3/(s sqrt(Pa))" with what flows and what drives it in the port's own units, as in "V/(s sqrt(V))".
std::string in_own_units(const Port& port, std::string unit) {
  const std::size_t per_second = port.unit.rfind("/s");
  if (port.kind == PortKind::flow && per_second != std::string::npos && per_second + 2 == port.unit.size())
    unit = replaced(unit, "m^3", port.unit.substr(0, per_second));
  return port.drop_unit.empty() ? unit : replaced(unit, "Pa", port.drop_unit);
}

}  // namespace

std::string effect_unit(const Datasheet& sheet, const Port& port, const std::string& unit) {
  // A port whose place bears the name of a channel, or its beginning, passes what that channel measures.
  const std::string place = port.channel.empty() ? port.name.substr(port.name.find('.') + 1) : port.channel;
  int channel = find_channel(sheet.channels, place);
  for (std::size_t c = 0; channel < 0 && port.kind == PortKind::source && c < sheet.channels.size(); ++c)
    if (sheet.channels[c].role == Role::input && sheet.channels[c].name.rfind(place + "_", 0) == 0)
      channel = static_cast<int>(c);
  // On a shaft forces are torques; a resistance is to volume flow, turning or not.
  const std::size_t either = unit.find(" or ");
  const bool turning = has_state(sheet, "rad/s") && !has_state(sheet, "m/s") && port.kind != PortKind::source;
  if (either != std::string::npos) return turning ? unit.substr(either + 4) : unit.substr(0, either);
  if (unit.compare(0, 4, "port") != 0) return in_own_units(port, unit);
  const std::string own = !port.unit.empty()             ? port.unit
                          : channel >= 0                 ? sheet.channels[static_cast<std::size_t>(channel)].unit
                          : port.kind != PortKind::force ? "port"
                          : turning                      ? "N m"
                                                         : "N";
  return own + unit.substr(4);
}

std::string parameter_unit(const Datasheet& sheet, const Port& port, const EffectType& effect,
                           const EffectParameter& parameter) {
  const auto own = port.units.find(effect.name + "." + parameter.name);
  return own == port.units.end() ? effect_unit(sheet, port, parameter.unit) : own->second;
}

}  // namespace faultline
