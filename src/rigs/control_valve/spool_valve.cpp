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
      spring_(facts.parameter("spool_spring")),
      pretension_(facts.parameter("spool_pretension")),
      diaphragm_(facts.parameter("diaphragm_stiffness")),
      viscous_(facts.parameter("spool_viscous")),
      coulomb_(facts.parameter("spool_coulomb")),
      port_area_(facts.parameter("port_area")),
      fill_factor_(facts.parameter("fill_cd_factor")),
      exhaust_factor_(facts.parameter("exhaust_cd_factor")) {}

double SpoolValve::balance(double supply_gauge) const {
  return (supply_area_ * supply_gauge + spring_ * (stroke_ / 2 + pretension_) + diaphragm_ * stroke_ / 2) /
         prestage_area_;
}

double SpoolValve::speed(double share, double prestage_gauge, double supply_gauge) const {
  const double position = share * stroke_;
  double force = prestage_area_ * prestage_gauge - supply_area_ * supply_gauge - spring_ * (position + pretension_) -
                 diaphragm_ * position;
  double plus = coulomb_, minus = coulomb_;
  if (!force_port_.empty()) {
    const BodyForces extra = force_port_.forces({position - stroke_ / 2, 0, 0});
    force -= extra.applied;
    plus += extra.sliding_plus;
    minus += extra.sliding_minus;
  }
  return within_stops(outside(force, -minus, plus) / viscous_, position, 0, stroke_);
}

double SpoolValve::flow(double share, double cylinder, double supply, double root) const {
  double opening = share - 0.5;
  if (!ports_.empty()) opening = ports_.opening(opening);
  if (opening > 0) {
    const Curve::Place ratio = fill_low_.place(cylinder / supply);
    const double low = fill_low_.at(ratio);
    const double cd = low + (fill_high_.at(ratio) - low) * std::clamp((share - 0.6) / 0.2, 0.0, 1.0);
    return air_flow(fill_factor_ * cd * port_area_ * opening / 0.5, supply, cylinder, root);
  }
  const Curve::Place gauge = exhaust_2_.place(cylinder - ambient_);
  const double middle = exhaust_2_.at(gauge);
  const double cd = share < 0.2 ? middle + (exhaust_0_.at(gauge) - middle) * std::min((0.2 - share) / 0.2, 1.0)
                                : middle + (exhaust_4_.at(gauge) - middle) * std::min((share - 0.2) / 0.2, 1.0);
  return -air_flow(exhaust_factor_ * cd * port_area_ * -opening / 0.5, cylinder, ambient_, root);
}

double SpoolValve::supply(double time, double share, double cylinder, double measured, double root) const {
  if (supply_port_.empty()) return measured;
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

double SpoolValve::prestage_rate(double share, double speed, double prestage, double net_flow, double heat) const {
  return gamma_ / (prestage_volume_ + prestage_area_ * share * stroke_) *
         (net_flow * heat - prestage * prestage_area_ * speed);
}

}  // namespace faultline
