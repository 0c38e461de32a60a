#include "faultline/numerics/integrator.h"

#include <stdexcept>

#include "faultline/numerics/rosenbrock.h"

namespace faultline {

std::unique_ptr<Integrator> make_integrator(OdeSystem& system) {
  if (system.stiff()) return std::make_unique<Rosenbrock>(system);
  const int states = system.states();
  if (states <= 8) return std::make_unique<RungeKutta4<8>>(system);
  if (states <= 16) return std::make_unique<RungeKutta4<16>>(system);
  if (states <= 32) return std::make_unique<RungeKutta4<32>>(system);
  if (states <= 64) return std::make_unique<RungeKutta4<64>>(system);
  throw std::logic_error("a system has more than 64 states");
}

}  // namespace faultline
