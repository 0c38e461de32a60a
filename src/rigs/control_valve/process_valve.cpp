#include "rigs/control_valve/process_valve.h"

#include <algorithm>
#include <cmath>

namespace faultline {

ProcessValve::ProcessValve(const ValveFacts& facts)
    : force_port_(facts.effects.at("force.valve")),
      restriction_port_(facts.effects.at("restriction.process_valve")),
      seal_mu_(facts.sheet, "seal_mu", "h", "value"),
      seal_torque_(facts.parameter("seal_friction_factor") * facts.parameter("seal_force") *
                   facts.constant("seal_lever")),
      windup_(facts.parameter("windup_angle")),
      per_windup_(1 / windup_),
      capacity_(facts.parameter("valve_cv")),
      linear_share_(facts.parameter("valve_cv_linear")),
      pump_pressure_(facts.parameter("pump_pressure")),
      open_ratio_(facts.parameter("open_pressure_ratio")) {}

ProcessValve::Seal ProcessValve::loaded_seal(double opening, double torque) const {
  const BodyForces extra = force_port_.forces({opening * kPi / 2, 0, pressure_drop(opening)});
  return {torque + extra.sliding_plus, torque + extra.sliding_minus};
}

double ProcessValve::relative_opening(double opening) const {
  double h = std::max(opening, 0.0), share = 1;
  if (!restriction_port_.empty()) {
    // The port's effects act at two places: what they leave of a full opening scales c, the rest bends h.
    share = restriction_port_.opening(1);
    h = share > 0 ? restriction_port_.opening(h) / share : h;
  }
  return share * (linear_share_ * h + (1 - linear_share_) * h * h * h);
}

double ProcessValve::pressure_drop(double opening) const {
  const double c = relative_opening(opening);
  return pump_pressure_ * open_ratio_ / (open_ratio_ + (1 - open_ratio_) * c * c);
}

double ProcessValve::flow(double opening) const {
  const double kUnits = 0.865 / 3600;  // C_v in gpm/psi^0.5 and bar to m^3/s
  return kUnits * capacity_ * relative_opening(opening) * std::sqrt(pressure_drop(opening) / 1e5);
}

double ProcessValve::opening_of(double goal) const {
  double low = 0, high = 1, opening = 0.5;
  for (int i = 0; i < 40; ++i) {
    opening = 0.5 * (low + high);
    (flow(opening) < goal ? low : high) = opening;
  }
  return opening;
}

}  // namespace faultline
