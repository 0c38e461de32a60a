#include "faultline/numerics/ode_system.h"

#include <stdexcept>

namespace faultline {

const std::vector<std::pair<int, int>>& OdeSystem::jacobian_entries() const {
  throw std::logic_error("a stiff system must have a Jacobian");
}

void OdeSystem::jacobian(double, const double*, const double*, double*, double*, double*) {
  throw std::logic_error("a stiff system must have a Jacobian");
}

}  // namespace faultline
