#include "faultline/rig/controller.h"

#include <cmath>

#include <fmt/format.h>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr std::uint64_t kSecondSeed = 15485863;  // so that a second set point does not move like the first
constexpr std::uint64_t kOwnSeed = 32452843;     // nor what the controller draws

// Commands that follow excitations by themselves, rounded to their resolution.
class OpenLoop : public Controller {
 public:
  OpenLoop(const Datasheet& sheet, const Profile& profile, std::uint64_t seed) {
    for (const DrivenCommand& command : profile.commands) {
      const auto channel = static_cast<std::size_t>(sheet.channel(command.channel));
      driven_.push_back({channel, sheet.channels[channel].resolution,
                         make_excitation(command.shape, command.settings, seed + driven_.size() * kSecondSeed)});
    }
  }
  void reset() override {}
  void step(double time, double* channels) override {
    for (const Driven& d : driven_) {
      const double value = d.excitation->value(time);
      channels[d.channel] = d.resolution > 0 ? std::round(value / d.resolution) * d.resolution : value;
    }
  }

 private:
  struct Driven {
    std::size_t channel;
    double resolution;
    std::unique_ptr<Excitation> excitation;
  };
  std::vector<Driven> driven_;
};

}  // namespace

std::unique_ptr<Controller> make_controller(const Datasheet& sheet, const Profile& profile, std::uint64_t seed) {
  if (profile.controller.empty()) return std::make_unique<OpenLoop>(sheet, profile, seed);
  const auto settings = sheet.controllers.find(profile.controller);
  if (settings == sheet.controllers.end())
    throw InputError(fmt::format("{}: profile '{}' asks for controller '{}', which has no entry under 'controllers'",
                                 sheet.file, profile.name, profile.controller));
  const ControllerType& type =
      registry<ControllerType>().require(sheet.rig + "/" + profile.controller, settings->second.where());
  RawSetPoints raw;
  raw.seed = seed + kOwnSeed;
  raw.first = make_excitation(profile.shape, profile.settings, seed);
  if (!profile.second_shape.empty())
    raw.second = make_excitation(profile.second_shape, profile.second_settings, seed + kSecondSeed);
  return type.make(sheet, settings->second, std::move(raw));
}

}  // namespace faultline
