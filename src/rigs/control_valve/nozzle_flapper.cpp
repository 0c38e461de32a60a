#include "rigs/control_valve/nozzle_flapper.h"

namespace faultline {
namespace {

double pressure_area(const ValveFacts& facts) {
  constexpr double kEffectiveRing = 0.4125;  // share of the nozzle's rim that the pressure acts on, (15)
  const double inner = facts.parameter("nozzle_inner_diameter");
  const double effective = inner + kEffectiveRing * (facts.parameter("nozzle_outer_diameter") - inner);
  return kPi / 4 * effective * effective;
}

}  // namespace

NozzleFlapper::NozzleFlapper(const ValveFacts& facts)
    : restrictor_port_(facts.effects.at("restriction.fixed_restrictor")),
      nozzle_port_(facts.effects.at("restriction.nozzle")),
      leak_(facts, "flow.prestage_ambient"),
      nozzle_cd_(facts.sheet, "nozzle_cd", "x_m", "value"),
      ambient_(facts.constant("atmospheric_pressure")),
      limit_(facts.constant("flapper_limit")),
      coil_reference_(facts.constant("coil_reference_temperature")),
      restrictor_area_(facts.parameter("restrictor_cd") * kPi / 4 *
                       std::pow(facts.parameter("restrictor_diameter"), 2)),
      nozzle_rim_(facts.parameter("nozzle_cd_factor") * kPi * facts.parameter("nozzle_inner_diameter")),
      spring_(facts.parameter("flapper_spring")),
      per_damping_(1 / facts.parameter("flapper_damping")),
      rest_(facts.parameter("flapper_rest")),
      coil_factor_(facts.parameter("coil_force_factor")),
      coil_temperature_(facts.parameter("coil_temp_coef")),
      pressure_0_(facts.parameter("pressure_coef_0")),
      pressure_1_(facts.parameter("pressure_coef_1")),
      pressure_area_(pressure_area(facts)) {}

}  // namespace faultline
