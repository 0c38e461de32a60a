#include "faultline/isolation/balance_model.h"

#include "faultline/signal/error.h"

namespace faultline {
namespace {

std::vector<BalanceModelType>& registry() {
  static std::vector<BalanceModelType> types;
  return types;
}

}  // namespace

bool register_balance_model(BalanceModelType type) {
  registry().push_back(std::move(type));
  return true;
}

std::unique_ptr<BalanceModel> make_balance_model(const std::string& name, const Datasheet& sheet,
                                                 const Settings& settings) {
  std::string known;
  for (const auto& type : registry()) {
    if (type.name == name) return type.make(sheet, settings);
    known += (known.empty() ? "" : ", ") + type.name;
  }
  throw InputError(settings.where() + ": there is no balance model '" + name + "'; there are " + known);
}

}  // namespace faultline
