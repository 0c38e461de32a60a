#include "faultline/rig/rig.h"

#include <stdexcept>

namespace faultline {

const std::vector<std::pair<int, int>>& Rig::jacobian_entries() const {
  throw std::logic_error("a stiff rig must have a Jacobian");
}

void Rig::jacobian(double, const double*, const double*, double*, double*, double*) {
  throw std::logic_error("a stiff rig must have a Jacobian");
}

}  // namespace faultline
