#include "faultline/estimators/relation_model.h"

#include "faultline/signal/error.h"

namespace faultline {
namespace {

std::vector<RelationModelType>& registry() {
  static std::vector<RelationModelType> types;
  return types;
}

}  // namespace

bool register_relation_model(RelationModelType type) {
  registry().push_back(std::move(type));
  return true;
}

std::unique_ptr<RelationModel> make_relation_model(const std::string& name, const Datasheet& sheet,
                                                   const Settings& settings) {
  std::string known;
  for (const auto& type : registry()) {
    if (type.name == name) return type.make(sheet, settings);
    known += (known.empty() ? "" : ", ") + type.name;
  }
  throw InputError(settings.where() + ": there is no relation model '" + name + "'; there are " + known);
}

}  // namespace faultline
