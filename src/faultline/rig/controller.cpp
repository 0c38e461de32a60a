#include "faultline/rig/controller.h"

#include <fmt/format.h>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr std::uint64_t kSecondSeed = 15485863;  // so that a second set point does not move like the first

}  // namespace

std::unique_ptr<Controller> make_controller(const Datasheet& sheet, const Profile& profile, std::uint64_t seed) {
  const auto settings = sheet.controllers.find(profile.controller);
  if (settings == sheet.controllers.end())
    throw InputError(fmt::format("{}: profile '{}' asks for controller '{}', which has no entry under 'controllers'",
                                 sheet.file, profile.name, profile.controller));
  const ControllerType& type =
      registry<ControllerType>().require(sheet.rig + "/" + profile.controller, settings->second.where());
  RawSetPoints raw;
  raw.first = make_excitation(profile.shape, profile.settings, seed);
  if (!profile.second_shape.empty())
    raw.second = make_excitation(profile.second_shape, profile.second_settings, seed + kSecondSeed);
  return type.make(sheet, settings->second, std::move(raw));
}

}  // namespace faultline
