// The spool valve module of the control valve: prestage chamber, diaphragms, spool and its ports, and the supply in
// front of them (Manninen 2012).
//
//   P_p' = gamma/(V_p + A_p X) (m R T_a - P_p A_p X')                                       (7)
//   b_s X' = dz(A_p p_p - A_s p_S - k_ss (X + x_spre) - k_d X, -F_cs, F_cs)                 (8)-(10)
//   s > 0.5: m_c = m(f_fi fill_cd(s, P_c/P_S) A_v (s - 0.5)/0.5, P_S, P_c)
//   s <= 0.5: m_c = -m(f_ex exhaust_cd(s, p_c) A_v (0.5 - s)/0.5, P_c, P_a)
//
// s = X/L_s. Capitals P absolute, small p gauge; m: air_flow.h. SI units.
#pragma once

#include <algorithm>

#include "rigs/control_valve/air_flow.h"
#include "rigs/control_valve/curve.h"
#include "rigs/control_valve/facts.h"

namespace faultline {

class SpoolValve {
 public:
  explicit SpoolValve(const ValveFacts& facts);

  double per_stroke() const { return per_stroke_; }  // 1/m
  double balance(double supply_gauge) const;         // Pa gauge, of the prestage, that holds the spool in the middle
  double speed(double share, double prestage_gauge, double supply_gauge) const;  // m/s
  double flow(double share, double cylinder, double supply, double root) const;  // kg/s, into the cylinder
  // Pa gauge at the device where the measured one is `measured`: with an effect at source.supply the filling flow
  // lowers the pressure that drives it.
  double supply(double time, double share, double cylinder, double measured, double root) const {
    return supply_port_.empty() ? measured : lowered_supply(time, share, cylinder, measured, root);
  }
  // Pa, of the prestage as the spool moves by such a share of its stroke without any flow, to first order.
  double pressure_rise(double share, double prestage, double way) const;
  double prestage_rate(double share, double speed, double prestage, double net_flow, double heat) const;  // Pa/s

 private:
  double lowered_supply(double time, double share, double cylinder, double measured, double root) const;
  double loaded_speed(double position, double force) const;  // with what acts at the port
  const EffectChain &force_port_, &ports_, &supply_port_;
  const Curve fill_low_, fill_high_, exhaust_0_, exhaust_2_, exhaust_4_;
  const double gamma_, ambient_, prestage_volume_, prestage_area_, supply_area_, stroke_, per_stroke_, spring_,
      pretension_, diaphragm_, per_viscous_, coulomb_, port_area_, fill_factor_, exhaust_factor_;
};

inline double SpoolValve::speed(double share, double prestage_gauge, double supply_gauge) const {
  const double position = share * stroke_;
  const double force = prestage_area_ * prestage_gauge - supply_area_ * supply_gauge -
                       spring_ * (position + pretension_) - diaphragm_ * position;
  const double speed =
      force_port_.empty() ? outside(force, -coulomb_, coulomb_) * per_viscous_ : loaded_speed(position, force);
  return within_stops(speed, position, 0, stroke_);
}

inline double SpoolValve::flow(double share, double cylinder, double supply, double root) const {
  double opening = share - 0.5;
  if (!ports_.empty()) opening = ports_.opening(opening);
  if (opening > 0) {
    const Curve::Place ratio = fill_low_.place(cylinder / supply);
    const double low = fill_low_.at(ratio);
    const double cd = low + (fill_high_.at(ratio) - low) * std::clamp((share - 0.6) * 5, 0.0, 1.0);
    return air_flow(fill_factor_ * cd * port_area_ * opening / 0.5, supply, cylinder, root);
  }
  const Curve::Place gauge = exhaust_2_.place(cylinder - ambient_);
  const double middle = exhaust_2_.at(gauge);
  const double cd = share < 0.2 ? middle + (exhaust_0_.at(gauge) - middle) * std::min((0.2 - share) * 5, 1.0)
                                : middle + (exhaust_4_.at(gauge) - middle) * std::min((share - 0.2) * 5, 1.0);
  return -air_flow(exhaust_factor_ * cd * port_area_ * -opening / 0.5, cylinder, ambient_, root);
}

inline double SpoolValve::prestage_rate(double share, double speed, double prestage, double net_flow,
                                        double heat) const {
  return gamma_ / (prestage_volume_ + prestage_area_ * share * stroke_) *
         (net_flow * heat - prestage * prestage_area_ * speed);
}

}  // namespace faultline
