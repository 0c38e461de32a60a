#include "faultline/rig/rig.h"

namespace faultline {
namespace {

std::vector<RigType>& registry() {
  static std::vector<RigType> types;
  return types;
}

}  // namespace

const std::vector<RigType>& rig_types() { return registry(); }

const RigType* find_rig_type(const std::string& name) {
  for (const auto& type : registry())
    if (type.name == name) return &type;
  return nullptr;
}

bool register_rig(RigType type) {
  registry().push_back(std::move(type));
  return true;
}

}  // namespace faultline
