// A controller runs once per sample on the measured channels and writes the set points and commands of the same row,
// which are held until the next. A loop inside the rig that is faster than its recording has a period of its own.
// Controllers register themselves as rig/name. A profile without one is run in an open loop: each of its commands
// follows an excitation.
#pragma once

#include <memory>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "faultline/rig/datasheet.h"
#include "faultline/rig/excitation.h"
#include "faultline/signal/error.h"
#include "faultline/signal/registry.h"

namespace faultline {

class Controller {
 public:
  virtual ~Controller() = default;
  virtual void reset() = 0;
  // `channels`: one value per channel of the rig; measured ones are filled. Writes set points and commands. time in s.
  virtual void step(double time, double* channels) = 0;

  // s, of a faster loop inside the rig, which a sample period must be a multiple of; 0: there is none.
  virtual double inner_period() const { return 0; }
  // That loop's step, once per inner period on channels measured at `time`, first at the sample itself after step().
  // Writes commands; the row then holds their mean over the sample period.
  virtual void inner_step(double /*time*/, double* /*channels*/) {}
};

// What a profile asks for, before any filter of the controller; most have one.
struct RawSetPoints {
  std::unique_ptr<Excitation> first, second;
  std::uint64_t seed = 0;  // of what the controller itself draws
};

struct ControllerType {
  static constexpr const char* kKind = "controller";
  std::string name;  // rig/name
  std::unique_ptr<Controller> (*make)(const Datasheet& sheet, const Settings& settings, RawSetPoints raw);
};

std::unique_ptr<Controller> make_controller(const Datasheet& sheet, const Profile& profile, std::uint64_t seed);

// For a T that takes one raw set point, or both.
template <class T>
std::unique_ptr<Controller> make_controller_of(const Datasheet& sheet, const Settings& settings, RawSetPoints raw) {
  if constexpr (std::is_constructible_v<T, const Datasheet&, const Settings&, RawSetPoints>) {
    return std::make_unique<T>(sheet, settings, std::move(raw));
  } else {
    if (raw.second)
      throw InputError(settings.where() +
                       ": this controller follows one raw set point; take 'second' out of the profile");
    return std::make_unique<T>(sheet, settings, std::move(raw.first));
  }
}

}  // namespace faultline

#define FAULTLINE_CONTROLLER(name, ...) FAULTLINE_REGISTER(ControllerType, name, __VA_ARGS__)
