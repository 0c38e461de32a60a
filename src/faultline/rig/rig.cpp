#include "faultline/rig/rig.h"

#include <fmt/format.h>

#include "faultline/rig/yaml_reader.h"
#include "faultline/signal/error.h"

namespace faultline {

void check_state_names(const Datasheet& sheet, const std::vector<std::string>& names) {
  for (std::size_t i = 0; i < sheet.states.size() && i < names.size(); ++i)
    if (sheet.states[i].name != names[i])
      throw InputError(fmt::format("{} is state {}, '{}'; the equations of {} have '{}' there, in the order {}",
                                   sheet.place("states." + sheet.states[i].name), i + 1, sheet.states[i].name,
                                   sheet.rig, names[i], joined(names)));
  if (sheet.states.size() != names.size())
    throw InputError(fmt::format("{} are {}; the equations of {} have {}: {}", sheet.place("states"),
                                 sheet.states.size(), sheet.rig, names.size(), joined(names)));
}

}  // namespace faultline
