#include "faultline/rig/controller.h"

#include <fmt/format.h>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr std::uint64_t kSecondSeed = 15485863;  // so that a second set point does not move like the first

std::vector<ControllerType>& registry() {
  static std::vector<ControllerType> types;
  return types;
}

}  // namespace

const std::vector<ControllerType>& controller_types() { return registry(); }

bool register_controller(ControllerType type) {
  registry().push_back(std::move(type));
  return true;
}

std::unique_ptr<Controller> make_controller(const Datasheet& sheet, const Profile& profile, std::uint64_t seed) {
  const auto settings = sheet.controllers.find(profile.controller);
  if (settings == sheet.controllers.end())
    throw InputError(fmt::format("{}: profile '{}' asks for controller '{}', which has no entry under 'controllers'",
                                 sheet.file, profile.name, profile.controller));
  for (const auto& type : registry()) {
    if (type.rig != sheet.rig || type.name != profile.controller) continue;
    RawSetPoints raw;
    raw.first = make_excitation(profile.shape, profile.settings, seed);
    if (!profile.second_shape.empty())
      raw.second = make_excitation(profile.second_shape, profile.second_settings, seed + kSecondSeed);
    return type.make(sheet, settings->second, std::move(raw));
  }
  throw InputError(fmt::format("{}: this build has no controller '{}' for {}", settings->second.where(),
                               profile.controller, sheet.rig));
}

}  // namespace faultline
