// Effects that swing by themselves, with the time or with the angle of a shaft: each run begins at a phase of its own.
#pragma once

#include <cstddef>
#include <optional>

#include "faultline/rig/effect.h"

namespace faultline {

// The phase grows with 2 pi frequency times the time [s], or with order times the angle [rad].
struct Swing {
  std::size_t frequency = 0, phase = 0;          // places in the effect's list
  bool by_angle = false;                         // `frequency` is an order, pulses per turn
  double rate(double frequency_or_order) const;  // rad per s, or per rad
};

// Nothing: the effect does not swing. A frequency has the unit Hz, a phase rad, and an order that name.
std::optional<Swing> swing_of(const EffectType& type);

}  // namespace faultline
