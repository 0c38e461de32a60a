#include "rigs/control_valve/spool_valve.h"

#include <algorithm>

#include "rigs/control_valve/air_flow.h"

namespace faultline {

SpoolValve::SpoolValve(const ValveFacts& facts)
    : force_port_(facts.effects.at("force.spool")),
      ports_(facts.effects.at("restriction.spool_ports")),
      supply_port_(facts.effects.at("source.supply")),
      fill_low_(facts.sheet, "fill_cd", "pressure_ratio", "s_0.6"),
      fill_high_(facts.sheet, "fill_cd", "pressure_ratio", "s_0.8_and_1"),
      exhaust_0_(facts.sheet, "exhaust_cd", "p_c_Pa", "s_0"),
      exhaust_2_(facts.sheet, "exhaust_cd", "p_c_Pa", "s_0.2"),
      exhaust_4_(facts.sheet, "exhaust_cd", "p_c_Pa", "s_0.4"),
      gamma_(facts.constant("gamma")),
      ambient_(facts.constant("atmospheric_pressure")),
      prestage_volume_(facts.parameter("prestage_volume")),
      prestage_area_(facts.parameter("prestage_area")),
      supply_area_(facts.parameter("supply_area")),
      stroke_(facts.parameter("spool_stroke")),
      per_stroke_(1 / stroke_),
      spring_(facts.parameter("spool_spring")),
      pretension_(facts.parameter("spool_pretension")),
      diaphragm_(facts.parameter("diaphragm_stiffness")),
      per_viscous_(1 / facts.parameter("spool_viscous")),
      coulomb_(facts.parameter("spool_coulomb")),
      port_area_(facts.parameter("port_area")),
      fill_factor_(facts.parameter("fill_cd_factor")),
      exhaust_factor_(facts.parameter("exhaust_cd_factor")) {}

double SpoolValve::balance(double supply_gauge) const {
  return (supply_area_ * supply_gauge + spring_ * (stroke_ / 2 + pretension_) + diaphragm_ * stroke_ / 2) /
         prestage_area_;
}

double SpoolValve::pressure_rise(double share, double prestage, double way) const {
  return prestage_rate(share, way * stroke_, prestage, 0, 0);
}

double SpoolValve::loaded_speed(double position, double force) const {
  const BodyForces extra = force_port_.forces({position - stroke_ / 2, 0, 0});
  return outside(force - extra.applied, -coulomb_ - extra.sliding_minus, coulomb_ + extra.sliding_plus) * per_viscous_;
}

double SpoolValve::lowered_supply(double time, double share, double cylinder, double measured, double root) const {
  // p - boundary(m(p)) rises with p, between what all of the flow at the undisturbed pressure leaves and that pressure.
  constexpr int kMostSteps = 40;
  const auto left = [&](double supply) {
    const double filling = std::max(0.0, flow(share, cylinder, supply + ambient_, root));
    return supply_port_.boundary(measured, filling, time);
  };
  double high = supply_port_.boundary(measured, 0, time), low = left(high);
  for (int i = 0; i < kMostSteps && high - low > 1; ++i) {
    const double middle = 0.5 * (low + high);
    const double end = left(middle);
    if (middle > end) {
      high = middle;
      low = std::max(low, end);
    } else {
      low = middle;
      high = std::min(high, end);
    }
  }
  return 0.5 * (low + high);
}

}  // namespace faultline
