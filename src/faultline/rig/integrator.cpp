#include "faultline/rig/integrator.h"

#include <stdexcept>

#include "faultline/rig/rosenbrock.h"

namespace faultline {

std::unique_ptr<Integrator> make_integrator(Rig& rig) {
  if (rig.stiff()) return std::make_unique<Rosenbrock>(rig);
  const int states = rig.states();
  if (states <= 8) return std::make_unique<RungeKutta4<8>>(rig);
  if (states <= 16) return std::make_unique<RungeKutta4<16>>(rig);
  if (states <= 32) return std::make_unique<RungeKutta4<32>>(rig);
  if (states <= 64) return std::make_unique<RungeKutta4<64>>(rig);
  throw std::logic_error("a rig has more than 64 states");
}

}  // namespace faultline
