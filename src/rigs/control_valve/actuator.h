// The actuator module of the control valve: cylinder, spring-return piston and the linkage that turns its travel into
// an angle (Manninen 2012).
//
//   P_c' = gamma/(V_d + A_c x) (m R T_a - P_c A_c x')                                (7)
//   b_a x' = dz(A_c p_c - k_a (x + x_a0) - T_v phi'(x), -F_c-(x), F_c+(x))           (12)
//   phi(x) = pi/4 + asin((x - L/2)/r),  r = L/sqrt(2)
//
// The piston has no mass: it moves as fast as viscous friction lets its force, once that leaves the Coulomb band.
// Friction that falls with speed has no such answer near standstill: there the piston sticks until its force exceeds
// the breakaway level and slips at the highest speed in balance. Capitals P absolute, small p gauge. SI units.
#pragma once

#include <algorithm>
#include <cmath>

#include "faultline/numerics/cubic_table.h"
#include "rigs/control_valve/air_leak.h"
#include "rigs/control_valve/curve.h"

namespace faultline {

// Of the crank from the middle, rad.
inline double lever_angle(double opening) { return (opening - 0.5) * (kPi / 2); }

// By opening; within 1e-9.
inline const CubicTable<512> lever_sine(
    0, 1, [](double h) { return std::sin(lever_angle(h)); },
    [](double h) { return kPi / 2 * std::cos(lever_angle(h)); });
inline const CubicTable<512> inverse_cosine(
    0, 1, [](double h) { return 1 / std::cos(lever_angle(h)); },
    [](double h) { return kPi / 2 * std::tan(lever_angle(h)) / std::cos(lever_angle(h)); });

class Actuator {
 public:
  explicit Actuator(const ValveFacts& facts);

  struct Lever {
    double travel, ratio;  // m; phi', rad/m
  };
  Lever lever(double opening) const;
  double travel(double opening) const { return lever(opening).travel; }
  double angle(double travel) const;  // rad
  double ratio(double travel) const;  // phi', rad/m
  double rest_pressure(double travel) const {
    return spring_rate_ * (travel + spring_pretension_) / area_;
  }  // Pa gauge

  // Of the piston, at a load in N: torque times ratio. m/s
  double speed(double travel, double cylinder_gauge, double load) const;
  double cylinder_rate(double travel, double speed, double cylinder, double net_flow, double heat) const;  // Pa/s
  // Pa, of the cylinder as the piston moves by so much without any flow, to first order.
  double pressure_rise(double travel, double cylinder, double way) const;
  double leak(double cylinder, double root) const { return leak_(cylinder, root); }  // kg/s

  // Whether it slips, where friction falls with speed: after each step, and never at first.
  bool may_slip(double opening) const { return !force_port_.empty() && ends_of_friction(travel(opening)).falls(); }
  void follow_slip(double travel, double cylinder_gauge, double load);
  void stick() { slip_ = 0; }

 private:
  double force(double travel, double cylinder_gauge, double load) const;
  double applied_force(double travel) const;  // at the port
  Lever lever_at_stop(double opening) const;
  double speed_at(double travel, double force) const;
  double slip_speed(double travel, double force, double plus, double minus) const;

  struct EndsOfFriction {  // of what acts at the port: at rest, and at a speed at which what falls has fallen
    BodyForces rest, fast;
    bool falls() const { return rest.breakaway_plus > fast.sliding_plus || rest.breakaway_minus > fast.sliding_minus; }
  };
  EndsOfFriction ends_of_friction(double travel) const;

  const EffectChain &force_port_, &cylinder_port_;
  const AirLeak leak_;
  const Curve coulomb_plus_, coulomb_minus_;
  const double gamma_, stroke_, crank_, per_crank_, area_, dead_volume_, spring_rate_, spring_pretension_, viscous_,
      per_viscous_, plus_factor_, minus_factor_;
  int slip_ = 0;  // direction
};

inline Actuator::Lever Actuator::lever(double opening) const {
  if (!(opening > 0 && opening < 1)) return lever_at_stop(opening);
  const auto place = lever_sine.place(opening);
  return {stroke_ / 2 + crank_ * lever_sine.at(place), inverse_cosine.at(place) * per_crank_};
}

inline double Actuator::force(double travel, double cylinder_gauge, double load) const {
  double force = area_ * cylinder_gauge - spring_rate_ * (travel + spring_pretension_) - load;
  if (!force_port_.empty()) force -= applied_force(travel);
  return force;
}

inline double Actuator::speed(double travel, double cylinder_gauge, double load) const {
  return speed_at(travel, force(travel, cylinder_gauge, load));
}

inline double Actuator::speed_at(double travel, double force) const {
  const Curve::Place place = coulomb_plus_.place(travel);
  const double plus = plus_factor_ * coulomb_plus_.at(place), minus = minus_factor_ * coulomb_minus_.at(place);
  const double speed =
      force_port_.empty() ? outside(force, -minus, plus) * per_viscous_ : slip_speed(travel, force, plus, minus);
  return within_stops(speed, travel, 0, stroke_);
}

inline double Actuator::cylinder_rate(double travel, double speed, double cylinder, double net_flow,
                                      double heat) const {
  const double rate = gamma_ / (dead_volume_ + area_ * travel) * (net_flow * heat - cylinder * area_ * speed);
  return cylinder_port_.empty() ? rate : rate * cylinder_port_.bulk_modulus(1, cylinder);
}

}  // namespace faultline
