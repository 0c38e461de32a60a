#include "faultline/detectors/detector.h"

#include "faultline/signal/error.h"

namespace faultline {
namespace {

std::vector<DetectorType>& registry() {
  static std::vector<DetectorType> types;
  return types;
}

}  // namespace

bool register_detector(DetectorType type) {
  registry().push_back(std::move(type));
  return true;
}

const std::vector<DetectorType>& detector_types() { return registry(); }

std::unique_ptr<Detector> make_detector(const StageSpec& spec) {
  std::string known;
  for (const auto& type : registry()) {
    if (type.name == spec.type) return type.make(spec.settings);
    known += (known.empty() ? "" : ", ") + type.name;
  }
  throw InputError(spec.settings.where() + ": there is no detector type '" + spec.type + "'; there are " + known);
}

std::size_t find_quantity(const Estimate& estimate, const std::string& name) {
  for (std::size_t i = 0; i < estimate.quantities.size(); ++i)
    if (estimate.quantities[i].name == name) return i;
  std::string known;
  for (const Quantity& quantity : estimate.quantities) known += (known.empty() ? "" : ", ") + quantity.name;
  throw InputError("a detector asks for the quantity '" + name + "', which the estimator does not give; it gives " +
                   known);
}

}  // namespace faultline
