#include "rigs/control_valve/actuator.h"

#include <algorithm>
#include <cmath>

#include "faultline/numerics/cubic_table.h"

namespace faultline {
namespace {

// Of the crank from the middle, rad.
double lever_angle(double opening) { return (opening - 0.5) * (kPi / 2); }

// By opening; within 1e-9.
const CubicTable<512> lever_sine(
    -0.02, 1.02, [](double h) { return std::sin(lever_angle(h)); },
    [](double h) { return kPi / 2 * std::cos(lever_angle(h)); });
const CubicTable<512> inverse_cosine(
    -0.02, 1.02, [](double h) { return 1 / std::cos(lever_angle(h)); },
    [](double h) { return kPi / 2 * std::tan(lever_angle(h)) / std::cos(lever_angle(h)); });

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
      plus_factor_(facts.parameter("coulomb_pos_factor")),
      minus_factor_(facts.parameter("coulomb_neg_factor")) {}

// At its stops to the last digit: there it stands.
double Actuator::travel(double opening) const {
  const double sine = lever_sine.holds(opening) ? lever_sine(opening) : std::sin(lever_angle(opening));
  const double travel = stroke_ / 2 + crank_ * sine;
  return opening >= 1 ? std::max(travel, stroke_) : opening <= 0 ? std::min(travel, 0.0) : travel;
}

double Actuator::angle(double travel) const {
  return kPi / 4 + std::asin(std::clamp((travel - stroke_ / 2) / crank_, -1.0, 1.0));
}

double Actuator::ratio(double travel) const {
  const double lever = travel - stroke_ / 2;
  return 1 / std::sqrt(std::max(crank_ * crank_ - lever * lever, 0.01 * crank_ * crank_));
}

double Actuator::ratio_at(double opening) const {
  return inverse_cosine.holds(opening) ? inverse_cosine(opening) * per_crank_ : ratio(travel(opening));
}

double Actuator::force(double travel, double cylinder_gauge, double load) const {
  double force = area_ * cylinder_gauge - spring_rate_ * (travel + spring_pretension_) - load;
  if (!force_port_.empty()) force -= force_port_.forces({travel - stroke_ / 2, 0, 0}).applied;
  return force;
}

double Actuator::speed(double travel, double cylinder_gauge, double load) const {
  return speed_at(travel, force(travel, cylinder_gauge, load));
}

double Actuator::speed_at(double travel, double force) const {
  const Curve::Place place = coulomb_plus_.place(travel);
  const double plus = plus_factor_ * coulomb_plus_.at(place), minus = minus_factor_ * coulomb_minus_.at(place);
  const double speed =
      force_port_.empty() ? outside(force, -minus, plus) / viscous_ : slip_speed(travel, force, plus, minus);
  return within_stops(speed, travel, 0, stroke_);
}

// Friction may fall with speed: then it has two levels, at rest and when fast.
double Actuator::slip_speed(double travel, double force, double plus, double minus) const {
  constexpr double kFast = 1e3;  // m/s, at which friction that falls with speed has fallen
  constexpr int kMostSteps = 40;
  const double at = travel - stroke_ / 2;
  const BodyForces fast = force_port_.forces({at, kFast, 0}), rest = force_port_.forces({at, 0, 0});
  const double viscous = viscous_ + fast.viscous / kFast;
  const double fast_plus = plus + fast.sliding_plus, fast_minus = minus + fast.sliding_minus;
  if (rest.breakaway_plus <= fast.sliding_plus && rest.breakaway_minus <= fast.sliding_minus)
    return outside(force, -fast_minus, fast_plus) / viscous;
  if (slip_ == 0) return 0;
  // From above, b v + level(v) = |F|: the iteration falls to the highest speed in balance, or to rest where there is
  // none.
  double speed = std::max(0.0, slip_ * outside(force, -fast_minus, fast_plus) / viscous);
  for (int i = 0; i < kMostSteps && speed > 0; ++i) {
    const BodyForces now = force_port_.forces({at, slip_ * speed, 0});
    const double level = slip_ > 0 ? plus + now.sliding_plus : minus + now.sliding_minus;
    const double next = std::max(0.0, (slip_ * force - level) / viscous);
    if (speed - next <= 1e-6 * speed) break;
    speed = next;
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

double Actuator::cylinder_rate(double travel, double speed, double cylinder, double net_flow, double heat) const {
  const double rate = gamma_ / (dead_volume_ + area_ * travel) * (net_flow * heat - cylinder * area_ * speed);
  return cylinder_port_.empty() ? rate : rate * cylinder_port_.bulk_modulus(1, cylinder);
}

}  // namespace faultline
