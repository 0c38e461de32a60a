#include "faultline/estimators/process_model.h"

#include "faultline/signal/error.h"

namespace faultline {
namespace {

std::vector<ProcessModelType>& registry() {
  static std::vector<ProcessModelType> types;
  return types;
}

}  // namespace

bool register_process_model(ProcessModelType type) {
  registry().push_back(std::move(type));
  return true;
}

std::unique_ptr<ProcessModel> make_process_model(const std::string& name, const Datasheet& sheet,
                                                 const Settings& settings) {
  std::string known;
  for (const auto& type : registry()) {
    if (type.name == name) return type.make(sheet, settings);
    known += (known.empty() ? "" : ", ") + type.name;
  }
  throw InputError(settings.where() + ": there is no process model '" + name + "'; there are " + known);
}

}  // namespace faultline
