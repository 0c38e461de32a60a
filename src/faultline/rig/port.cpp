#include "faultline/rig/port.h"

#include <array>
#include <utility>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr std::array<std::pair<PortKind, const char*>, 10> kNames = {{
    {PortKind::command, "command"},
    {PortKind::sensor, "sensor"},
    {PortKind::force, "force"},
    {PortKind::flow, "flow"},
    {PortKind::restriction, "restriction"},
    {PortKind::compliance, "compliance"},
    {PortKind::source, "source"},
    {PortKind::transmission, "transmission"},
    {PortKind::line, "line"},
    {PortKind::heat, "heat"},
}};

}  // namespace

std::string to_string(PortKind kind) {
  for (const auto& [value, name] : kNames)
    if (value == kind) return name;
  return "";
}

PortKind port_kind(const std::string& port_name) {
  const std::string head = port_name.substr(0, port_name.find('.'));
  for (const auto& [value, name] : kNames)
    if (head == name && port_name.size() > head.size() + 1) return value;
  throw InputError("port '" + port_name + "' is not of the form kind.place; kinds are command, sensor, force, flow, " +
                   "restriction, compliance, source, transmission, line, heat");
}

std::vector<PassingQuantity> passing(PortKind kind) {
  switch (kind) {
    case PortKind::command:
    case PortKind::sensor:
      return {{"signal", "port"}};
    case PortKind::force:
      return {{"position", "m or rad"}, {"velocity", "m/s or rad/s"}, {"load", "Pa"}};
    case PortKind::flow:
      return {{"pressure_drop", "Pa"}, {"upstream", "Pa"}, {"shaft_speed", "rad/s"}};
    case PortKind::restriction:
      return {{"opening", "port"}};
    case PortKind::compliance:
      return {{"absolute_pressure", "Pa"}};
    case PortKind::source:
      return {{"value", "port"}, {"flow", "m^3/s"}};
    case PortKind::transmission:
    case PortKind::line:
    case PortKind::heat:
      return {};
  }
  return {};
}

}  // namespace faultline
