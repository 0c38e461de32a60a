// Types of one kind by name: effects, rigs, controllers, models, estimators, detectors, isolators. Each adds itself
// from its own file before main starts, or when a library that holds it is loaded, so that a new one needs no other
// file. A kind is a plain struct with `name`, what makes one, and `static constexpr const char* kKind`, the word for it
// in messages.
//
// One list per kind in the whole process, shared libraries included; two of one name end the program before main, or
// make the library useless that is loaded later (rig/rig_library.h). References stay good whatever is added; but what
// adds (loading a library) must not run beside what reads.
#pragma once

#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "faultline/signal/error.h"

namespace faultline {

// Where names that are taken are told while a library is being loaded, since no exception may leave its initialisers;
// else null, and they are an exception.
inline std::vector<std::string>*& taken_names() {
  static std::vector<std::string>* names = nullptr;
  return names;
}

struct ByName {
  using is_transparent = void;
  template <class Type>
  bool operator()(const Type& a, const Type& b) const {
    return a.name < b.name;
  }
  template <class Type>
  bool operator()(const Type& a, const std::string& b) const {
    return a.name < b;
  }
  template <class Type>
  bool operator()(const std::string& a, const Type& b) const {
    return a < b.name;
  }
};

template <class Type>
class Registry {
 public:
  using Types = std::set<Type, ByName>;

  bool add(Type type) {
    const std::string name = type.name;
    if (types_.insert(std::move(type)).second) return true;
    const std::string text = std::string("two of the kind '") + Type::kKind + "' are called '" + name + "'";
    if (!taken_names()) throw std::logic_error(text);
    taken_names()->push_back(text);
    return false;
  }
  const Types& all() const { return types_; }        // sorted by name
  const Type* find(const std::string& name) const {  // nullptr if there is none
    const auto place = types_.find(name);
    return place != types_.end() ? &*place : nullptr;
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
  Types types_;
};

template <class Type>
Registry<Type>& registry() {
  static Registry<Type> types;
  return types;
}

}  // namespace faultline

// At namespace scope of the type's own file: registers it before main starts, or when its library is loaded. `id`:
// unique among those of its kind in that file.
#define FAULTLINE_REGISTER(Type, id, ...) \
  const bool registered_##Type##_##id = ::faultline::registry<::faultline::Type>().add(::faultline::Type __VA_ARGS__)
