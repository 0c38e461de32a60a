#include "faultline/rig/swing.h"

namespace faultline {
namespace {

constexpr double kTwoPi = 6.283185307179586;

}  // namespace

double Swing::rate(double frequency_or_order) const {
  return by_angle ? frequency_or_order : kTwoPi * frequency_or_order;
}

std::optional<Swing> swing_of(const EffectType& type) {
  const std::size_t count = type.parameters.size(), phase = type.with_unit("rad"), frequency = type.with_unit("Hz");
  if (phase >= count) return std::nullopt;
  if (frequency < count) return Swing{frequency, phase, false};
  const int order = type.parameter_index("order");
  if (order < 0) return std::nullopt;
  return Swing{static_cast<std::size_t>(order), phase, true};
}

}  // namespace faultline
