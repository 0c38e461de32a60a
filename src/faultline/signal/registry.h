// Types of one kind by name: effects, rigs, controllers, models, estimators, detectors, isolators. Each adds itself
// from its own file before main starts, so that a new one needs no other file. A kind is a plain struct with `name`,
// what makes one, and `static constexpr const char* kKind`, the word for it in messages.
//
// One list per kind in the whole process, shared libraries included; two of one name end the program before main.
// References stay good once main runs.
#pragma once

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "faultline/signal/error.h"

namespace faultline {

template <class Type>
class Registry {
 public:
  bool add(Type type) {
    const auto place = std::lower_bound(types_.begin(), types_.end(), type.name, before);
    if (place != types_.end() && place->name == type.name)
      throw std::logic_error(std::string("two of the kind '") + Type::kKind + "' are called '" + type.name + "'");
    types_.insert(place, std::move(type));
    return true;
  }
  const std::vector<Type>& all() const { return types_; }  // sorted by name
  const Type* find(const std::string& name) const {        // nullptr if there is none
    const auto place = std::lower_bound(types_.begin(), types_.end(), name, before);
    return place != types_.end() && place->name == name ? &*place : nullptr;
  }
  // InputError that begins with `where` (file, line and key) and lists what there is.
  const Type& require(const std::string& name, const std::string& where) const {
    if (const Type* type = find(name)) return *type;
    std::string known;
    for (const Type& type : types_) known += (known.empty() ? "" : ", ") + type.name;
    throw InputError(where + ": there is no " + Type::kKind + " '" + name + "'; there are " +
                     (known.empty() ? "none" : known));
  }

 private:
  static bool before(const Type& type, const std::string& name) { return type.name < name; }

  std::vector<Type> types_;
};

template <class Type>
Registry<Type>& registry() {
  static Registry<Type> types;
  return types;
}

}  // namespace faultline

// At namespace scope of the type's own file: registers it before main starts. `id`: unique among those of its kind in
// that file.
#define FAULTLINE_REGISTER(Type, id, ...) \
  const bool registered_##Type##_##id = ::faultline::registry<::faultline::Type>().add(::faultline::Type __VA_ARGS__)
