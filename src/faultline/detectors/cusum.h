// Two-sided cumulative sum test. Sources: Page, "Continuous inspection schemes", Biometrika 41 (1954); Iannetti,
// Marzat, Piet-Lahanier et al., Fault diagnosis benchmark for a rocket engine demonstrator (2015), equation (19).
//
//   up = max(up + r - delta/2, 0),  down = max(down - r - delta/2, 0);   alarm: up or down above lambda
// r is the residual less its mean, in any unit; delta the smallest change that matters, lambda the threshold, both in
// that unit. Both sums stop at twice lambda, so that an alarm ends soon after its cause. Not finite residuals must be
// kept away.
#pragma once

#include <algorithm>
#include <cstdint>

namespace faultline {

struct TwoSidedCusum {
  double allowance = 0;  // delta/2
  double threshold = 1;  // lambda
  double up = 0, down = 0;
  std::uint32_t up_steps = 0, down_steps = 0;  // since each sum left zero: when the change began, as estimated

  void reset() { up = down = 0, up_steps = down_steps = 0; }

  bool update(double r) {
    const double ceiling = 2 * threshold;
    up = std::min(up + r - allowance, ceiling);
    down = std::min(down - r - allowance, ceiling);
    up_steps = up > 0 ? up_steps + 1 : 0;
    down_steps = down > 0 ? down_steps + 1 : 0;
    up = std::max(up, 0.0);
    down = std::max(down, 0.0);
    return up > threshold || down > threshold;
  }
  std::uint32_t steps() const { return up >= down ? up_steps : down_steps; }
};

}  // namespace faultline
