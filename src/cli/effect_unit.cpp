#include "cli/effect_unit.h"

namespace faultline {

std::string effect_unit(const Datasheet& sheet, const Port& port, const std::string& unit) {
  const int channel = port.channel.empty() ? -1 : find_channel(sheet.channels, port.channel);
  if (channel < 0 || unit.compare(0, 4, "port") != 0) return unit;
  return sheet.channels[static_cast<std::size_t>(channel)].unit + unit.substr(4);
}

}  // namespace faultline
