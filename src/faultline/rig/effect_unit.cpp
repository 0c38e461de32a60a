#include "faultline/rig/effect_unit.h"

#include <algorithm>

namespace faultline {
namespace {

bool has_state(const Datasheet& sheet, const std::string& unit) {
  return std::any_of(sheet.states.begin(), sheet.states.end(), [&](const State& s) { return s.unit == unit; });
}

}  // namespace

std::string effect_unit(const Datasheet& sheet, const Port& port, const std::string& unit) {
  // A port whose place bears the name of a channel passes what that channel measures.
  const std::string place = port.channel.empty() ? port.name.substr(port.name.find('.') + 1) : port.channel;
  const int channel = find_channel(sheet.channels, place);
  const std::size_t either = unit.find(" or ");
  if (either != std::string::npos)
    return has_state(sheet, "rad/s") && !has_state(sheet, "m/s") ? unit.substr(either + 4) : unit.substr(0, either);
  if (channel < 0 || unit.compare(0, 4, "port") != 0) return unit;
  return sheet.channels[static_cast<std::size_t>(channel)].unit + unit.substr(4);
}

}  // namespace faultline
