#include "faultline/detectors/detector.h"

#include "faultline/signal/error.h"

namespace faultline {
std::size_t find_quantity(const Estimate& estimate, const std::string& name) {
  for (std::size_t i = 0; i < estimate.quantities.size(); ++i)
    if (estimate.quantities[i].name == name) return i;
  std::string known;
  for (const Quantity& quantity : estimate.quantities) known += (known.empty() ? "" : ", ") + quantity.name;
  throw InputError("a detector asks for the quantity '" + name + "', which the estimator does not give; it gives " +
                   known);
}

}  // namespace faultline
