#include "faultline/isolation/isolator.h"

#include "faultline/signal/error.h"

namespace faultline {
namespace {

std::vector<IsolatorType>& registry() {
  static std::vector<IsolatorType> types;
  return types;
}

}  // namespace

bool register_isolator(IsolatorType type) {
  registry().push_back(std::move(type));
  return true;
}

std::unique_ptr<Isolator> make_isolator(const Datasheet& sheet, const StageSpec& spec) {
  std::string known;
  for (const auto& type : registry()) {
    if (type.name == spec.type) return type.make(sheet, spec);
    known += (known.empty() ? "" : ", ") + type.name;
  }
  throw InputError(spec.settings.where() + ": there is no isolator type '" + spec.type + "'; there are " + known);
}

}  // namespace faultline
