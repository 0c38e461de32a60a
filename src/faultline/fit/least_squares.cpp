#include "faultline/fit/least_squares.h"

#include "faultline/signal/late_library.h"

namespace faultline {

bool minimise(const LeastSquares& problem, std::vector<double>& z) {
  using Minimise = bool(const LeastSquares&, std::vector<double>&);
  static Minimise* const minimise = late<Minimise>("faultline_ceres", "faultline_minimise");
  return minimise(problem, z);
}

}  // namespace faultline
