// The shipped datasheets: they hold what their sources hold, and name only effects that the library has.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "config_folder.h"
#include "faultline/rig/datasheet.h"
#include "faultline/rig/effect.h"
#include "faultline/rig/effect_unit.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

namespace fs = std::filesystem;

Datasheet shipped(const std::string& rig) { return find_datasheet(config_folder(), rig); }

double nominal(const Datasheet& sheet, const std::string& name) {
  return sheet.nominal()[static_cast<std::size_t>(sheet.parameter(name))];
}

const Channel& channel(const Datasheet& sheet, const std::string& name) {
  return sheet.channels[static_cast<std::size_t>(sheet.channel(name))];
}

Bounds bounds(const Datasheet& sheet, const std::string& port, const std::string& effect,
              const std::string& parameter) {
  for (const FittingEffect& fitting : sheet.port(port).effects)
    if (fitting.effect == effect) return fitting.bounds.at(parameter);
  ADD_FAILURE() << effect << " does not fit " << port;
  return {};
}

struct Count {
  const char* rig;
  std::size_t channels, states, parameters, ports, faults;
  double sample_period;
};

TEST(ShippedDatasheets, SizesOfEveryFittingEffectHaveAUnit) {
  for (const Datasheet& sheet : read_datasheets(config_folder()))
    for (const Port& port : sheet.ports)
      for (const FittingEffect& fitting : port.effects)
        for (const EffectParameter& parameter : find_effect_type(fitting.effect)->parameters)
          EXPECT_EQ(parameter_unit(sheet, port, *find_effect_type(fitting.effect), parameter).find("port"),
                    std::string::npos)
              << sheet.rig << ": " << fitting.effect << "@" << port.name << ":" << parameter.name;
}

TEST(ShippedDatasheets, HoldWhatTheirSourcesHold) {
  const Count counts[] = {{"control_valve", 13, 6, 38, 20, 10, 0.01},
                          {"cooling_circuit", 28, 23, 36, 78, 27, 0.001},
                          {"hydraulic_drive", 6, 4, 12, 16, 12, 0.01},
                          {"pump_cylinder", 9, 4, 19, 20, 10, 0.001},
                          {"servo_actuator", 12, 7, 19, 16, 9, 0.001}};
  const std::vector<Datasheet> sheets = read_datasheets(config_folder());
  ASSERT_EQ(sheets.size(), 5u);
  for (std::size_t i = 0; i < 5; ++i) {
    SCOPED_TRACE(counts[i].rig);
    EXPECT_EQ(sheets[i].rig, counts[i].rig);
    EXPECT_EQ(sheets[i].channels.size(), counts[i].channels);
    EXPECT_EQ(sheets[i].states.size(), counts[i].states);
    EXPECT_EQ(sheets[i].parameters.size(), counts[i].parameters);
    EXPECT_EQ(sheets[i].ports.size(), counts[i].ports);
    EXPECT_EQ(sheets[i].faults.size(), counts[i].faults);
    EXPECT_DOUBLE_EQ(sheets[i].sample_period, counts[i].sample_period);
    EXPECT_FALSE(sheets[i].profiles.empty());
    EXPECT_FALSE(sheets[i].nuisance.empty());
    EXPECT_FALSE(sheets[i].notes.empty());
  }
}

TEST(ShippedDatasheets, ServoActuator) {
  const Datasheet sheet = shipped("servo_actuator");
  EXPECT_DOUBLE_EQ(nominal(sheet, "compliance"), 1.14e-12);
  EXPECT_DOUBLE_EQ(nominal(sheet, "flow_coefficient"), 1.47e-8);
  EXPECT_DOUBLE_EQ(sheet.parameters[static_cast<std::size_t>(sheet.parameter("compliance"))].tolerance, 0.15);
  std::size_t identified = 0;
  for (const Parameter& parameter : sheet.parameters) identified += parameter.identify ? 1 : 0;
  EXPECT_EQ(identified, 10u);
  EXPECT_DOUBLE_EQ(sheet.constants.at("supply_pressure_set"), 6.89e6);
  EXPECT_EQ(channel(sheet, "position").role, Role::output);
  EXPECT_DOUBLE_EQ(channel(sheet, "position").noise_std, 5e-5);
  EXPECT_DOUBLE_EQ(channel(sheet, "load_pressure").minimum, -7e6);
  for (const Channel& c : sheet.channels)
    EXPECT_EQ(c.ground_truth, c.name == "leak_valve_command" || c.name == "leak_flow") << c.name;
  EXPECT_DOUBLE_EQ(sheet.port("command.valve_command").range, 10);
  EXPECT_DOUBLE_EQ(sheet.port("restriction.valve").range, 10);
  EXPECT_EQ(sheet.port("command.valve_command").channel, "valve_command");
  EXPECT_EQ(sheet.port("force.piston").channel, "");
  EXPECT_EQ(sheet.port("force.piston").effects.size(), 9u);
  EXPECT_TRUE(std::isinf(bounds(sheet, "sensor.position", "stuck", "from").maximum));
  EXPECT_DOUBLE_EQ(bounds(sheet, "line.valve_cylinder", "line_inertia", "inertance").maximum, 1.5e8);
  ASSERT_EQ(sheet.inputs.size(), 2u);
  EXPECT_DOUBLE_EQ(sheet.inputs[0].level.value, 6.89e6);
  EXPECT_DOUBLE_EQ(sheet.inputs[0].wander_high, 5);
  EXPECT_DOUBLE_EQ(sheet.controllers.at("position_control").number("position_gain", 0, 1e9), 2e5);
  EXPECT_DOUBLE_EQ(sheet.profile("square").settings.number("period", 0, 100), 20);
  EXPECT_EQ(sheet.profile("prbs").controller, "open_loop");
  const CommandTable& steps = sheet.fault("internal_leak_steps").commands.at(0);
  EXPECT_EQ(steps.channel, "leak_valve_command");
  EXPECT_EQ(steps.time.size(), 16u);
  EXPECT_DOUBLE_EQ(steps.time[9], 140.001);
  EXPECT_DOUBLE_EQ(steps.value[9], 5);
}

TEST(ShippedDatasheets, HydraulicDrive) {
  const Datasheet sheet = shipped("hydraulic_drive");
  EXPECT_DOUBLE_EQ(nominal(sheet, "inertia"), 1.5606e-3);
  EXPECT_EQ(sheet.port("command.valve").channel, "valve_voltage");
  EXPECT_DOUBLE_EQ(sheet.port("restriction.valve").range, 2e-4);
  EXPECT_EQ(sheet.fault("set_3").effects.size(), 5u);
  EXPECT_DOUBLE_EQ(bounds(sheet, "restriction.valve", "clogging", "fraction").minimum, -0.15);
}

TEST(ShippedDatasheets, PumpCylinder) {
  const Datasheet sheet = shipped("pump_cylinder");
  EXPECT_EQ(channel(sheet, "pump1_speed").predicted_by, "pump1_speed_command");
  EXPECT_EQ(sheet.port("command.pump1_speed").channel, "pump1_speed_command");
  EXPECT_EQ(sheet.port("sensor.pump1_speed").channel, "pump1_speed");
  EXPECT_DOUBLE_EQ(nominal(sheet, "offset_gain"), -1.753009e-7);
}

TEST(ShippedDatasheets, ControlValve) {
  const Datasheet sheet = shipped("control_valve");
  EXPECT_EQ(sheet.not_recorded.size(), 2u);
  ASSERT_EQ(sheet.tables.size(), 6u);
  EXPECT_EQ(sheet.tables[0].name, "nozzle_cd");
  EXPECT_DOUBLE_EQ(sheet.tables[0].columns.at("value").at(1), 0.9467);
  EXPECT_DOUBLE_EQ(sheet.tables[1].columns.at("s_0.8_and_1").at(3), 0.54);
  EXPECT_DOUBLE_EQ(sheet.constants.at("stroke"), 0.0776);
  EXPECT_DOUBLE_EQ(nominal(sheet, "valve_cv"), 90);
}

TEST(ShippedDatasheets, CoolingCircuitIsExpandedByBranch) {
  const Datasheet sheet = shipped("cooling_circuit");
  EXPECT_EQ(sheet.branches, (std::vector<std::string>{"m", "v1", "v2", "v3", "t"}));
  EXPECT_EQ(sheet.channels[3].name, "m_inlet_pressure");
  EXPECT_EQ(sheet.channels[7].name, "m_outlet_temperature");
  EXPECT_EQ(sheet.channels[8].name, "v1_inlet_pressure");
  EXPECT_EQ(sheet.channels[27].name, "t_outlet_temperature");
  EXPECT_EQ(sheet.states[3].name, "m_p1");
  EXPECT_EQ(sheet.states[22].name, "t_t2");
  EXPECT_DOUBLE_EQ(nominal(sheet, "v3_c"), 0.0042);
  EXPECT_DOUBLE_EQ(nominal(sheet, "t_c"), 0.0018);
  EXPECT_DOUBLE_EQ(nominal(sheet, "v1_heat_flux"), 1.4e5);
  EXPECT_EQ(sheet.port("sensor.v2_outlet_pressure").channel, "v2_outlet_pressure");
  EXPECT_DOUBLE_EQ(sheet.port("restriction.m_orifice").range, 1.5);
  EXPECT_DOUBLE_EQ(sheet.port("restriction.t_orifice").range, 2.0);
  EXPECT_THROW(sheet.port("flow.{b}_drain_ambient"), InputError);
}

TEST(ShippedDatasheets, UseEffectsThatTheLibraryHas) {
  for (const Datasheet& sheet : read_datasheets(config_folder()))
    for (const Port& port : sheet.ports)
      for (const FittingEffect& fitting : port.effects) {
        SCOPED_TRACE(sheet.rig + ": " + fitting.effect + "@" + port.name);
        const EffectType* type = find_effect_type(fitting.effect);
        ASSERT_NE(type, nullptr);
        EXPECT_TRUE(type->fits_kind(port.kind));
        // A parameter without bounds stays at its no-effect or usual value, so it must have one.
        for (const EffectParameter& parameter : type->parameters)
          EXPECT_TRUE(fitting.bounds.count(parameter.name) > 0 || !std::isnan(not_given(parameter))) << parameter.name;
        for (const auto& [name, bound] : fitting.bounds) {
          const int index = type->parameter_index(name);
          ASSERT_GE(index, 0) << name;
          EXPECT_GE(bound.minimum, type->parameters[static_cast<std::size_t>(index)].minimum) << name;
          EXPECT_LE(bound.maximum, type->parameters[static_cast<std::size_t>(index)].maximum) << name;
        }
      }
}

TEST(ShippedDatasheets, HaveFaultsWithinTheBoundsOfTheirPorts) {
  for (const Datasheet& sheet : read_datasheets(config_folder())) {
    std::vector<std::string> texts = sheet.nuisance;
    for (const Fault& fault : sheet.faults) texts.insert(texts.end(), fault.effects.begin(), fault.effects.end());
    for (const std::string& text : texts) {
      SCOPED_TRACE(sheet.rig + ": " + text);
      const EffectSpec spec = parse_effect(text);
      const EffectType* type = find_effect_type(spec.effect);
      for (std::size_t i = 0; i < type->parameters.size(); ++i) {
        if (!std::isnan(type->parameters[i].usual)) continue;  // a shape of which a datasheet need say nothing
        const Bounds bound = bounds(sheet, spec.port, spec.effect, type->parameters[i].name);
        EXPECT_GE(spec.parameters[i], bound.minimum);
        EXPECT_LE(spec.parameters[i], bound.maximum);
      }
    }
  }
}

}  // namespace
}  // namespace faultline
