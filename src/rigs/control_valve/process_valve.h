// The process valve of the control valve: seal of the segment, and the liquid that it lets through from the pump
// (Manninen 2012).
//
//   phi_w T_v' = w T_c - |w| T_v,  T_c = f_mu mu(h) F_seal l,  w the shaft's speed, in place of (11)
//   Q = 0.865 C_v c sqrt(dp/1e5)/3600,  dp = dp_0 DP_f/(DP_f + (1 - DP_f) c^2),  c = a h + (1 - a) h^3   (13), (14)
//
// SI units, C_v in gpm/psi^0.5.
#pragma once

#include "rigs/control_valve/curve.h"
#include "rigs/control_valve/facts.h"

namespace faultline {

class ProcessValve {
 public:
  struct Seal {  // T_c in both directions, N m
    double plus = 0, minus = 0;
  };

  explicit ProcessValve(const ValveFacts& facts);

  double windup() const { return windup_; }  // phi_w, rad
  double per_windup() const { return per_windup_; }
  Seal seal(double opening) const;
  double pressure_drop(double opening) const;  // Pa
  double flow(double opening) const;           // m^3/s
  double opening_of(double flow) const;        // h at which it is so

 private:
  Seal loaded_seal(double opening, double torque) const;  // with what acts at the port
  double relative_opening(double opening) const;          // c

  const EffectChain &force_port_, &restriction_port_;
  const Curve seal_mu_;
  const double seal_torque_, windup_, per_windup_, capacity_, linear_share_, pump_pressure_, open_ratio_;
};

inline ProcessValve::Seal ProcessValve::seal(double opening) const {
  const double torque = seal_torque_ * seal_mu_(opening);
  return force_port_.empty() ? Seal{torque, torque} : loaded_seal(opening, torque);
}

}  // namespace faultline
