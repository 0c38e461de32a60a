#include "rigs/control_valve/actuator.h"

#include <algorithm>
#include <cmath>

namespace faultline {
namespace {

constexpr double kFast = 1e3;  // m/s, at which friction that falls with speed has fallen

}  // namespace

Actuator::Actuator(const ValveFacts& facts)
    : force_port_(facts.effects.at("force.actuator")),
      cylinder_port_(facts.effects.at("compliance.cylinder")),
      leak_(facts, "flow.cylinder_ambient"),
      coulomb_plus_(facts.sheet, "coulomb_pos", "x_m", "value_N"),
      coulomb_minus_(facts.sheet, "coulomb_neg", "x_m", "value_N"),
      gamma_(facts.constant("gamma")),
      stroke_(facts.constant("stroke")),
      crank_(stroke_ / std::sqrt(2.0)),
      per_crank_(1 / crank_),
      area_(facts.parameter("cylinder_area")),
      dead_volume_(facts.parameter("dead_volume")),
      spring_rate_(facts.parameter("spring_rate")),
      spring_pretension_(facts.parameter("spring_pretension")),
      viscous_(facts.parameter("actuator_viscous")),
      per_viscous_(1 / viscous_),
      plus_factor_(facts.parameter("coulomb_pos_factor")),
      minus_factor_(facts.parameter("coulomb_neg_factor")) {}

// At its stops to the last digit: there it stands.
Actuator::Lever Actuator::lever_at_stop(double opening) const {
  const double travel = stroke_ / 2 + crank_ * std::sin(lever_angle(opening));
  const double at_stop = opening >= 1 ? std::max(travel, stroke_) : opening <= 0 ? std::min(travel, 0.0) : travel;
  return {at_stop, ratio(at_stop)};
}

double Actuator::pressure_rise(double travel, double cylinder, double way) const {
  return cylinder_rate(travel, way, cylinder, 0, 0);
}

double Actuator::applied_force(double travel) const { return force_port_.forces({travel - stroke_ / 2, 0, 0}).applied; }

double Actuator::angle(double travel) const {
  return kPi / 4 + std::asin(std::clamp((travel - stroke_ / 2) / crank_, -1.0, 1.0));
}

double Actuator::ratio(double travel) const {
  const double lever = travel - stroke_ / 2;
  return 1 / std::sqrt(std::max(crank_ * crank_ - lever * lever, 0.01 * crank_ * crank_));
}

Actuator::EndsOfFriction Actuator::ends_of_friction(double travel) const {
  const double at = travel - stroke_ / 2;
  return {force_port_.forces({at, 0, 0}), force_port_.forces({at, kFast, 0})};
}

// Friction may fall with speed: then it has two levels, at rest and when fast.
double Actuator::slip_speed(double travel, double force, double plus, double minus) const {
  constexpr int kMostSteps = 40;
  const double at = travel - stroke_ / 2;
  const EndsOfFriction ends = ends_of_friction(travel);
  const BodyForces& fast = ends.fast;
  const double viscous = viscous_ + fast.viscous / kFast;
  const double fast_plus = plus + fast.sliding_plus, fast_minus = minus + fast.sliding_minus;
  if (!ends.falls()) return outside(force, -fast_minus, fast_plus) / viscous;
  if (slip_ == 0) return 0;
  // From above, b v + level(v) = |F|: v -> (|F| - level(v))/b falls to the highest speed in balance, or to rest where
  // there is none. Where two are in balance, v - (|F| - level(v))/b is convex from the higher one on (exp(-v^2) is,
  // beyond its steepest fall): the chord of the last two steps meets zero above it. Where one is, it may lie below it.
  double speed = std::max(0.0, slip_ * outside(force, -fast_minus, fast_plus) / viscous);
  double before = 0, excess_before = 0;
  bool chord = false, convex = true;
  for (int i = 0; i < kMostSteps && speed > 0; ++i) {
    const BodyForces now = force_port_.forces({at, slip_ * speed, 0});
    const double level = slip_ > 0 ? plus + now.sliding_plus : minus + now.sliding_minus;
    const double next = std::max(0.0, (slip_ * force - level) / viscous), excess = speed - next;
    if (chord && excess < 0) {  // below it
      speed = before - excess_before;
      chord = convex = false;
      continue;
    }
    if (excess <= 1e-6 * speed) break;
    const double slope = (excess_before - excess) / (before - speed);
    const double along = speed - excess / slope;
    chord = convex && i > 0 && slope > 0 && along > 0 && along < next;
    before = speed;
    excess_before = excess;
    speed = chord ? along : next;
  }
  return slip_ * speed;
}

void Actuator::follow_slip(double travel, double cylinder_gauge, double load) {
  const double now = force(travel, cylinder_gauge, load);
  if (slip_ != 0 && speed_at(travel, now) == 0) slip_ = 0;
  const BodyForces extra = force_port_.forces({travel - stroke_ / 2, 0, 0});
  if (slip_ == 0 && now > plus_factor_ * coulomb_plus_(travel) + extra.breakaway_plus) slip_ = 1;
  if (slip_ == 0 && now < -minus_factor_ * coulomb_minus_(travel) - extra.breakaway_minus) slip_ = -1;
}

}  // namespace faultline
