// Estimates made by hand: a rig on which nothing is the matter, and one on which everything is.
#pragma once

#include <cmath>

#include "faultline/detectors/detector.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {

// A white signal of sigma one, always the same at the same time.
inline double white(double time) {
  const double x = std::sin(std::fmod(time * 12989.8, 6.283185307179586)) * 43758.5453;
  return (x - std::floor(x) - 0.5) * std::sqrt(12.0);
}

inline std::size_t servo_ram_area() { return static_cast<std::size_t>(servo().parameter("ram_area")); }

inline Estimate quiet(double time) {
  Estimate estimate;
  estimate.time = time;
  estimate.observed = 4;
  estimate.normalised_innovation = 0.2;
  estimate.quantities = {{"leak_coefficient", "m^3/(s sqrt(Pa))", 0, 1e-9},
                         {"leak_flow", "m^3/s", 0, 0},
                         {"friction_force", "N", 0, 0},
                         {"pressure_parity", "Pa", 0, 0},
                         {"pressure_sum", "Pa", 0, 0},
                         {"leak_drive", "sqrt(Pa)", 800, 0},
                         {"shifting", "1", white(time), 0},
                         {"dying", "1", white(time), 0},
                         {"roughening", "1", white(time), 0},
                         {"swinging", "1", white(time), 0},
                         {"piston_flow", "m^3/s", 0, 0},
                         {"ram_area", "m^2", servo().nominal()[servo_ram_area()], 0}};
  return estimate;
}

inline Estimate loud(double time) {
  Estimate estimate = quiet(time);
  estimate.normalised_innovation = 40;
  estimate.quantities[0].value = 2e-8;
  estimate.quantities[3].value = 1e5;
  estimate.quantities[4].value = -2e6;
  estimate.quantities[6].value += 30;
  estimate.quantities[11].value *= 2;
  estimate.quantities[7].value = 0.25;
  estimate.quantities[8].value *= 30;
  estimate.quantities[9].value += 30 * std::sin(188.49555921538757 * time);  // 30 Hz
  return estimate;
}

}  // namespace faultline
