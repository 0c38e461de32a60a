// The datasheet reader: what the shipped datasheets hold, and that every wrong value is refused with the key and the
// line.
#include "faultline/rig/datasheet.h"
#include "config_folder.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

namespace fs = std::filesystem;

Datasheet shipped(const std::string& rig) { return find_datasheet(config_folder(), rig); }

// Text of the InputError that `action` throws; empty if it throws none.
template <class Action>
std::string complaint(Action action) {
  try {
    action();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(FindDatasheet, ListsTheRigsThereAre) {
  const std::string text = complaint([] { find_datasheet(config_folder(), "steam_engine"); });
  EXPECT_NE(text.find("steam_engine"), std::string::npos) << text;
  EXPECT_NE(text.find("control_valve, cooling_circuit, hydraulic_drive"), std::string::npos) << text;
  EXPECT_NE(complaint([] { read_datasheets("no/such/folder"); }).find("no/such/folder"), std::string::npos);
}

TEST(Datasheet, LookUpsNameWhatThereIs) {
  const Datasheet sheet = shipped("servo_actuator");
  EXPECT_NE(complaint([&] { sheet.channel("speed"); }).find("valve_command, leak_valve_command"), std::string::npos);
  EXPECT_NE(complaint([&] { sheet.parameter("speed"); }).find("ram_area"), std::string::npos);
  EXPECT_NE(complaint([&] { sheet.profile("speed"); }).find("square, random"), std::string::npos);
  EXPECT_NE(complaint([&] { sheet.fault("speed"); }).find("internal_leak_ramp"), std::string::npos);
}

// ---- What is refused. A small datasheet that is right; each case replaces one line of it.

const char* const kSmall = R"(rig: tank
title: A tank with two outlets
source: made up
sample_period: 0.1
branches: [a, b]
channels:
  - {name: valve, symbol: u, unit: V, role: command, range: [0, 10], noise_std: 0, resolution: 0, meaning: opening}
  - {name: supply, symbol: p, unit: Pa, role: input, range: [0, 1.0e+6], noise_std: 10, resolution: 1, meaning: supply}
  - {name: "{b}_level", symbol: h, unit: m, role: output, range: [0, 2], noise_std: 0.01, resolution: 0, meaning: "level {b}"}
  - {name: opening, symbol: z, unit: "1", role: input, range: [0, 1], noise_std: 0, resolution: 0, predicted_by: valve, ground_truth: true, meaning: plug}
not_recorded:
  - {name: vapour, symbol: m_v, unit: kg/s, meaning: what leaves}
states:
  - {name: "{b}_level", symbol: h, unit: m, measured_by: "{b}_level", initial: "where {b}_area balances", meaning: height}
parameters:
  - {name: density, symbol: rho, unit: kg/m^3, nominal: 1000, tolerance: 0.01, from: known}
  - {name: "{b}_area", symbol: A, unit: m^2, nominal: {a: 1, b: 2}, tolerance: 0.1, identify: true, from: chosen}
  - {name: stiffness, symbol: c, unit: N/m, nominal: 3, tolerance: 0.2, positive: true, from: chosen}
  - {name: shift, symbol: d, unit: s, nominal: -1, tolerance: 0, positive: false, from: chosen}
constants:
  gravity: {value: 9.81, unit: m/s^2, symbol: g, from: known}
  wall: {value: 20, unit: kg, from: known}
tables:
  curve: {columns: {x: [0, 1], y: [0, 2]}, from: chosen}
ports:
  command.valve: {component: valve, meaning: opening, range: 10, effects: {lag: {time_constant: [0, 1]}}}
  sensor.inflow: {component: gauge, meaning: supply, channel: supply, effects: {offset: {value: [-1, 1]}, stuck: {from: [0, .inf]}}}
  "flow.{b}_ambient": {component: wall, meaning: leak, effects: {orifice_leakage: {coefficient: [0, 1.0e-4]}}}
inputs:
  supply: {value: 5.0e+5, wander_std: 10, wander_low: 0.1, wander_high: 1, moves: {shape: triangle, amplitude: 3, period: 4}, lag: 0.1, lags: 2, droop: 5, droop_lag: 0.2, meaning: pump}
controllers:
  level_control: {gain: 2, period: 1, meaning: what it does}
profiles:
  - {name: steps, controller: level_control, shape: steps, duration: 10, low: 0, high: 1, shortest: 1, longest: 2, second: {shape: constant, value: 3}, inputs: {supply: 4.0e+5}, meaning: steps}
  - {name: ramp, controller: level_control, shape: table, duration: 10, time: [0, 5], value: [0, 1], inputs: {supply: {value: 3.0e+5}}, meaning: ramp}
  - {name: driven, duration: 10, meaning: open loop, commands: {valve: {shape: constant, value: 3.5}}}
faults:
  - {name: leak, meaning: leak at a, profile: steps, effects: ["orifice_leakage@flow.a_ambient:coefficient=1e-5,from=2,to=4"]}
  - {name: opened, meaning: valve opens, commands: {valve: {time: [1, 2], value: [0, 5]}}}
nuisance: ["lag@command.valve:time_constant=0.01"]
nominal_effects: ["offset@sensor.inflow:value=0.5"]
estimators:
  - {name: filter, type: kalman, q: 1, gains: [1, 2], kind: fast}
detectors: [{name: seal, type: leak, effect: orifice_leakage, port: flow.a_ambient}]
isolators: [{name: table, type: signatures}]
normal_gap: {a_level: 0.1}
segment: 0.5
conventions: prose
layout: prose
equations: prose
estimator_form: prose
initial_state: prose
integration: prose
reference_point: prose
leakage_conversion: prose
parameter_twins: prose
notes: [made up]
)";

class SmallDatasheet : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() /
              (std::string("datasheet_test_") + ::testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string write(const std::string& text, const std::string& name = "tank.yaml") const {
    fs::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name, std::ios::binary) << text;
    return (folder_ / name).string();
  }

  fs::path folder_;
};

TEST_F(SmallDatasheet, IsRead) {
  const Datasheet sheet = read_datasheet(write(kSmall));
  ASSERT_EQ(sheet.channels.size(), 5u);
  EXPECT_EQ(sheet.channels[3].name, "b_level");
  EXPECT_EQ(sheet.channels[3].meaning, "level b");
  EXPECT_EQ(sheet.nominal(), (std::vector<double>{1000, 1, 2, 3, -1}));
  EXPECT_TRUE(sheet.parameters[2].identify);
  EXPECT_EQ(sheet.states.at(1).channel, sheet.channel("b_level"));
  EXPECT_EQ(sheet.port("sensor.inflow").channel, "supply");
  EXPECT_EQ(sheet.port("flow.b_ambient").kind, PortKind::flow);
  EXPECT_EQ(sheet.profile("steps").second_shape, "constant");
  EXPECT_EQ(sheet.profile("steps").second_settings.number("value", 0, 9), 3);
  EXPECT_EQ(sheet.profile("steps").inputs.at("supply").value, 4e5);
  EXPECT_EQ(sheet.profile("steps").inputs.at("supply").shape, "triangle");
  EXPECT_EQ(sheet.profile("ramp").inputs.at("supply").shape, "");
  EXPECT_EQ(sheet.inputs.at(0).level.settings.number("amplitude", 0, 9), 3);
  EXPECT_EQ(sheet.inputs.at(0).lags, 2);
  EXPECT_EQ(sheet.inputs.at(0).droop, 5);
  EXPECT_EQ(sheet.fault("leak").effects.at(0), "orifice_leakage@flow.a_ambient:coefficient=1e-5,from=2,to=4");
  EXPECT_EQ(sheet.estimators.at(0).settings.word("kind"), "fast");
  EXPECT_EQ(sheet.estimators.at(0).settings.list("gains", 2, 0, 9), (std::vector<double>{1, 2}));
  EXPECT_DOUBLE_EQ(sheet.normal_gap.at("a_level"), 0.1);
  EXPECT_EQ(sheet.segment, 0.5);
}

struct Case {
  const char* from;  // in kSmall, first place
  const char* to;
  const char* key;  // must be in the complaint
  const char* why;  // so must this
};

const Case kCases[] = {
    // keys
    {"title:", "titel:", "titel", "is not known; allowed are rig, title"},
    {"title: A tank with two outlets\n", "", "title", "lacks the key"},
    {"symbol: u", "sybmol: u", "sybmol", "is not known; allowed are name, symbol"},
    {"noise_std: 10, ", "", "noise_std", "lacks the key"},
    {"symbol: m_v", "sign: m_v", "sign", "'not_recorded[0]'"},
    {"symbol: h, unit: m, measured", "symbol: h, units: m, measured", "units", "'states[0]'"},
    {"tolerance: 0.01", "tolerence: 0.01", "tolerence", "'parameters[0]'"},
    {"value: 9.81", "val: 9.81", "val", "'constants.gravity'"},
    {"from: chosen}\nports", "form: chosen}\nports", "form", "'tables.curve'"},
    {"component: valve", "part: valve", "part", "'ports.command.valve'"},
    {"wander_high: 1", "wander_hi: 1", "wander_hi", "'inputs.supply'"},
    {"shortest: 1", "shortst: 1", "shortest", "is missing"},
    {"longest: 2", "longest: 2, extra: 3", "extra", "not known"},
    {"profile: steps", "profil: steps", "profil", "'faults[0]'"},
    {"time: [1, 2]", "times: [1, 2]", "times", "'faults[1].commands.valve'"},
    {"type: kalman", "typ: kalman", "type", "lacks the key"},
    {"sample_period: 0.1", "sample_period: 0.1\nsample_period: 0.2", "sample_period", "given twice"},
    {"symbol: u,", "symbol: u, symbol: w,", "symbol", "given twice"},
    // types and ranges
    {"rig: tank", "rig: Tank One", "rig", "lower-case"},
    {"rig: tank", "rig: [tank]", "rig", "must be text"},
    {"title: A tank with two outlets", "title:", "title", "empty"},
    {"sample_period: 0.1", "sample_period: 0", "sample_period", "allowed is 0.0001 to 100"},
    {"sample_period: 0.1", "sample_period: 1e-300", "sample_period", "allowed is 0.0001 to 100"},
    {"sample_period: 0.1", "sample_period: 101", "sample_period", "allowed is 0.0001 to 100"},
    {"sample_period: 0.1", "sample_period: fast", "sample_period", "'fast', which is text"},
    {"sample_period: 0.1", "sample_period: \"0.1\"", "sample_period", "text"},
    {"sample_period: 0.1", "sample_period: .nan", "sample_period", "NaN"},
    {"sample_period: 0.1", "sample_period: .inf", "sample_period", "infinite"},
    {"sample_period: 0.1", "sample_period: 1e999", "sample_period", "must be a number"},
    {"branches: [a, b]", "branches: [a, a]", "branches[1]", "second time"},
    {"branches: [a, b]", "branches: a", "branches", "must be a list"},
    {"branches: [a, b]\n", "", "channels[2]", "branches"},
    {"name: valve, symbol", "name: Valve, symbol", "channels[0].name", "lower-case"},
    {"name: supply, symbol", "name: valve, symbol", "channels[1]", "'valve' a second time"},
    {"name: vapour", "name: valve", "not_recorded[0]", "second time"},
    {"role: command", "role: knob", "channels[0].role", "setpoint, command, input, output"},
    {"range: [0, 10], noise", "range: [10, 10], noise", "channels[0].range", "not below"},
    {"range: [0, 10], noise", "range: [0], noise", "channels[0].range", "[minimum, maximum]"},
    {"range: [0, 10], noise", "range: [0, ten], noise", "channels[0].range[1]", "text"},
    {"noise_std: 10", "noise_std: -10", "channels[1].noise_std", "0 or more"},
    {"noise_std: 10", "noise_std: much", "channels[1].noise_std", "'much', which is text"},
    {"resolution: 1,", "resolution: -1,", "channels[1].resolution", "0 or more"},
    {"resolution: 1,", "resolution: 1, ground_truth: maybe,", "ground_truth", "true or false"},
    {"resolution: 1,", "resolution: 1, predicted_by: b_level,", "predicted_by", "not a command"},
    {"resolution: 1,", "resolution: 1, predicted_by: knob,", "predicted_by", "channels are valve, supply"},
    {"resolution: 0, meaning: opening", "resolution: 0, predicted_by: valve, meaning: opening", "predicted_by",
     "input only"},
    {"nominal: 1000", "nominal: heavy", "parameters[0].nominal", "text"},
    {"nominal: 1000", "nominal: .nan", "parameters[0].nominal", "NaN"},
    {"nominal: 1000", "nominal: {a: 1, b: 2}", "parameters[0].nominal", "a mapping"},
    {"nominal: {a: 1, b: 2}", "nominal: {a: 1}", "parameters[1].nominal", "lacks the key 'b'"},
    {"nominal: {a: 1, b: 2}", "nominal: {a: 1, b: 2, c: 3}", "parameters[1].nominal", "key 'c'"},
    {"tolerance: 0.01", "tolerance: -0.01", "parameters[0].tolerance", "0 or more"},
    {"identify: true", "identify: 7", "parameters[1].identify", "true or false"},
    {"name: density", "name: a_area", "parameters[1]", "second time"},
    {"value: 9.81", "value: down", "constants.gravity.value", "text"},
    {"y: [0, 2]", "y: [0, 2, 3]", "tables.curve.columns.y", "same count"},
    // ports
    {"command.valve:", "control.valve:", "ports.control.valve", "kinds are command, sensor"},
    {"command.valve:", "command.knob:", "ports.command.knob", "channels are valve"},
    {"command.valve:", "command.supply:", "ports.command.supply", "role is input"},
    {"range: 10, effects", "range: 0, effects", "ports.command.valve.range", "above 0"},
    {"channel: supply", "channel: inflow", "ports.sensor.inflow.channel", "channels are valve"},
    {"channel: supply", "channel: valve", "ports.sensor.inflow.channel", "role is command"},
    {"component: wall", "component: wall, channel: supply", "channel", "command and sensor ports only"},
    {"component: wall", "component: wall, unit: m^3", "unit", "end in /s"},
    {"component: wall", "component: wall, drop_unit: m", "drop_unit", "needs 'range'"},
    {"component: wall", "component: wall, range: 2, drop_unit: mm", "drop_unit", "SI units"},
    {"component: valve", "component: valve, drop_unit: V", "drop_unit", "flow and restriction ports only"},
    {"component: valve", "component: valve, units: {elasticity.compliance: m/N}", "units", "effect.parameter"},
    {"component: wall", "component: wall, units: {orifice_leakage: m}", "units", "effect.parameter"},
    {"time_constant: [0, 1]", "time_constant: [2, 1]", "effects.lag.time_constant", "minimum 2 above its maximum 1"},
    {"time_constant: [0, 1]", "time_constant: [0, .nan]", "effects.lag.time_constant[1]", "NaN"},
    {"time_constant: [0, 1]", "time_constant: any", "effects.lag.time_constant", "must be a list"},
    {"time_constant: [0, 1]", "time_constant: [1]", "effects.lag.time_constant", "[minimum, maximum]"},
    {"{time_constant: [0, 1]}", "{}", "effects.lag", "at least one parameter"},
    {"sensor.inflow:", "command.valve:", "ports.command.valve", "given twice"},
    // runs
    {"supply: {value", "valve: {value", "inputs.valve", "role input"},
    {"supply: {value", "steam: {value", "inputs.steam", "channels are"},
    {"wander_std: 10", "wander_std: -10", "inputs.supply.wander_std", "0 or more"},
    {"wander_high: 1", "wander_high: 0.01", "inputs.supply.wander_high", "not above wander_low"},
    {"triangle", "trangle", "inputs.supply.moves", "no excitation shape 'trangle'"},
    {"{shape: triangle, amp", "{form: triangle, amp", "inputs.supply.moves", "lacks the key 'shape'"},
    {"amplitude: 3", "amplitude: high", "inputs.supply.moves", "'amplitude' must be a number"},
    {"lag: 0.1", "lag: 0", "inputs.supply.lag", "or more"},
    {"lag: 0.1, lags", "lags", "inputs.supply.lags", "needs 'lag'"},
    {"lags: 2", "lags: 0", "inputs.supply.lags", "allowed is 1 to 100"},
    {"droop: 5", "droop: -5", "inputs.supply.droop", "0 or more"},
    {"droop: 5, droop_lag", "droop_lag", "inputs.supply.droop_lag", "needs 'droop'"},
    {"droop: 5, droop_lag: 0.2", "droop: 5", "inputs.supply", "lacks the key 'droop_lag'"},
    {"{supply: {value: 3.0e+5}}", "{supply: {moves: 3.0e+5}}", "profiles[1].inputs.supply", "lacks the key 'value'"},
    {"gain: 2", "gain: .nan", "controllers.level_control.gain", "NaN"},
    {"gain: 2", "gain: {p: 2}", "controllers.level_control.gain", "must be text"},
    {"controller: level_control", "controller: guess", "profiles[0].controller", "controllers are level_control"},
    {"shape: steps", "shape: zigzag", "profiles[0]", "no excitation shape 'zigzag'"},
    {"duration: 10", "duration: 0", "profiles[0].duration", "out of range"},
    {"low: 0, high", "low: deep, high", "profiles[0]", "'low' must be a number"},
    {"{shape: constant", "{form: constant", "profiles[0].second", "lacks the key 'shape'"},
    {"shape: constant, value: 3", "shape: constant, level: 3", "profiles[0].second", "'value' is missing"},
    {"shape: constant", "shape: zigzag", "profiles[0].second", "no excitation shape 'zigzag'"},
    {"{valve: {shape: constant", "{supply: {shape: constant", "profiles[2].commands.supply", "role command"},
    {"open loop, commands", "open loop, shape: steps, commands", "profiles[2]", "'shape' is too much"},
    {"value: 3.5}}", "level: 3.5}}", "profiles[2].commands.valve", "'value' is missing"},
    {"{supply: 4.0e+5}", "{valve: 4.0e+5}", "profiles[0].inputs.valve", "role input"},
    {"{supply: 4.0e+5}", "{supply: high}", "profiles[0].inputs.supply", "text"},
    {"orifice_leakage@flow.a_", "orifice_leakage@flow.c_", "faults[0].effects[0]", "ports are command.valve"},
    {"orifice_leakage@", "laminar_leakage@", "faults[0].effects[0]", "there are orifice_leakage"},
    {"coefficient=1e-5", "size=1e-3", "faults[0].effects[0]", "it has coefficient, and from, to in s, swells"},
    {"coefficient=1e-5", "coefficient=big", "faults[0].effects[0]", "not a number"},
    {":coefficient=1e-5,from=2,to=4", "", "faults[0].effects[0]", "write effect@port"},
    {"profile: steps", "profile: waves", "faults[0].profile", "profiles are driven, ramp, steps"},
    {"commands: {valve: {time: [1, 2], value: [0, 5]}}", "commands: {}", "faults[1]", "needs 'effects' or 'commands'"},
    {"opens, commands: {valve", "opens, commands: {supply", "faults[1].commands.supply", "role command"},
    {"time: [1, 2]", "time: [1, 1]", "faults[1].commands.valve.time", "must rise"},
    {"time: [1, 2]", "time: [1, 2, 3]", "faults[1].commands.valve", "3 times and 2 values"},
    {"name: opened", "name: leak", "faults[1]", "second time"},
    {"lag@command.valve", "lag@command", "nuisance[0]", "ports are"},
    {"[\"offset@sensor.inflow:value=0.5\"]", "[5]", "nominal_effects[0]", "write effect@port"},
    {"type: leak", "type: Leak", "detectors[0].type", "lower-case"},
    {"{a_level: 0.1}", "{a_level: -1}", "normal_gap.a_level", "0 or more"},
    {"{a_level: 0.1}", "{c_level: 1}", "normal_gap.c_level", "channels are"},
    {"segment: 0.5", "segment: 0.0001", "segment", "at least 4 sample periods"},
    {"notes: [made up]", "notes: made up", "notes", "must be a list"},
    // units and signs
    {"symbol: u, unit: V", "symbol: u, unit: Vlt", "channels[0].unit", "'Vlt' is not known"},
    {"symbol: u, unit: V", "symbol: u, unit: mV", "channels[0].unit", "SI units"},
    {"symbol: p, unit: Pa", "symbol: p, unit: bar", "channels[1].unit", "SI units"},
    {"unit: kg/s", "unit: g/s", "not_recorded[0].unit", "SI units"},
    {"symbol: h, unit: m, measured", "symbol: h, unit: mm, measured", "states[0].unit", "SI units"},
    {"symbol: h, unit: m, measured", "symbol: h, unit: Pa, measured", "states[0].measured_by",
     "in m, but the state is in Pa"},
    {"unit: kg/m^3", "unit: kg/m3", "parameters[0].unit", "'m3' is not known"},
    {"unit: m/s^2", "unit: m/s^", "constants.gravity.unit", "a power must be"},
    {"nominal: 1000", "nominal: 0", "parameters[0].nominal", "a density must be above 0"},
    {"nominal: {a: 1, b: 2}", "nominal: {a: 1, b: -2}", "parameters[1].nominal", "-2 m^2; an area must be above 0"},
    {"nominal: {a: 1, b: 2}", "nominal: {a: 1, b: .inf}", "parameters[1].nominal", "infinite"},
    {"nominal: 3", "nominal: -3", "parameters[2].nominal", "declared positive must be above 0"},
    {"positive: true", "positive: yes please", "parameters[2].positive", "true or false"},
    {"nominal: -1, tolerance: 0, positive: false", "nominal: -1, tolerance: 0", "parameters[3].nominal",
     "a time must be"},
    {"tolerance: 0.01", "tolerance: 0.5", "parameters[0].tolerance", "below 0.5"},
    {"nominal: 3, tolerance: 0.2, positive: true", "nominal: 0, tolerance: 0.2, identify: true",
     "parameters[2].nominal", "no scale"},
    {"value: 20, unit: kg", "value: -20, unit: kg", "constants.wall.value", "a mass must be above 0"},
    // names
    {"measured_by: \"{b}_level\"", "measured_by: \"{b}_leval\"", "states[0].measured_by", "did you mean 'a_level'?"},
    {"measured_by: \"{b}_level\"", "measured_by: \"{c}_level\"", "states[0].measured_by", "lower-case"},
    {"measured_by: \"{b}_level\"", "measured_by: supply", "states[0].measured_by", "whose role is input"},
    {"measured_by: \"{b}_level\"", "measured_by: a_level", "states[0].measured_by",
     "measures the state 'a_level' already"},
    {"where {b}_area", "where {b}_aera", "states[0].initial", "did you mean 'a_area'?"},
    {"predicted_by: valve", "predicted_by: valvee", "predicted_by", "did you mean 'valve'?"},
    {"lag: {time", "lagg: {time", "ports.command.valve.effects.lagg", "no effect that the library has"},
    {"lag: {time", "lagg: {time", "ports.command.valve.effects.lagg", "did you mean 'lag'?"},
    {"lag: {time", "clogging: {time", "ports.command.valve.effects.clogging", "an effect for other kinds of ports"},
    {"time_constant: [0, 1]", "time_constnt: [0, 1]", "effects.lag.time_constnt", "did you mean 'time_constant'?"},
    {"time_constant: [0, 1]", "time_constant: [-1, 1]", "effects.lag.time_constant",
     "beyond what lag allows: 0 to 1e+06 s"},
    {"coefficient: [0, 1.0e-4]", "coefficient: [0, .inf]", "orifice_leakage.coefficient", "beyond what"},
    {"flow.a_ambient:", "flow.a_ambiant:", "faults[0].effects[0]", "did you mean 'flow.a_ambient'?"},
    {"coefficient=1e-5", "coefficient=-1", "faults[0].effects[0]", "outside 0..1000"},
    {"coefficient=1e-5", "coefficient=5e-4", "faults[0].effects[0]", "flow.a_ambient takes 0 to 0.0001"},
    {"time_constant=0.01", "time_constant=1.5", "nuisance[0]", "command.valve takes 0 to 1"},
    {"offset@sensor", "ofset@sensor", "nominal_effects[0]", "did you mean 'offset'?"},
    {"value=0.5", "valu=0.5", "nominal_effects[0]", "has no parameter 'valu'"},
    {"controller: level_control", "controller: levl_control", "profiles[0].controller",
     "did you mean 'level_control'?"},
    {"profile: steps", "profile: step", "faults[0].profile", "did you mean 'steps'?"},
    {"time: [0, 5]", "time: [5, 0]", "profiles[1]", "must rise"},
    {"time: [0, 5]", "time: []", "profiles[1]", "at least one number"},
    {"longest: 2", "longest: 0.5", "profiles[0]", "'longest' is 0.5"},
    {"supply: {value: 5.0e+5", "supply: {value: 5.0e+7", "inputs.supply.value", "0 to 1e+06"},
    {"{supply: 4.0e+5}", "{supply: -1}", "profiles[0].inputs.supply", "0 to 1e+06"},
    {"value: [0, 5]}", "value: [0, 50]}", "faults[1].commands.valve.value[1]", "0 to 10"},
    {"wander_low: 0.1", "wander_low: 0", "inputs.supply.wander_low", "or more"},
    {"kind: fast", "kind: \"{b}_fast\"", "estimators[0].kind", "stands for a branch"},
    {"effect: orifice_leakage, port", "effect: orifice_leakge, port", "detectors[0]",
     "did you mean 'orifice_leakage'?"},
    {"effect: orifice_leakage, port", "effect: lag, port", "detectors[0]", "does not fit the port flow.a_ambient"},
    {"port: flow.a_ambient", "port: flow.a_ambent", "detectors[0]", "did you mean 'flow.a_ambient'?"},
    {"{a_level: 0.1}", "{a_levl: 1}", "normal_gap.a_levl", "did you mean 'a_level'?"},
};

int line_of(const std::string& text, std::size_t at) {
  return 1 + static_cast<int>(std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n'));
}

TEST_F(SmallDatasheet, OneWrongValueIsRefusedWithKeyAndLine) {
  for (const Case& one : kCases) {
    SCOPED_TRACE(std::string(one.from) + "  ->  " + one.to);
    std::string text = kSmall;
    const auto at = text.find(one.from);
    ASSERT_NE(at, std::string::npos);
    text.replace(at, std::string(one.from).size(), one.to);
    const std::string file = write(text);
    const std::string said = complaint([&] { read_datasheet(file); });
    EXPECT_NE(said.find(one.key), std::string::npos) << said;
    EXPECT_NE(said.find(one.why), std::string::npos) << said;
    EXPECT_EQ(said.find('\n'), std::string::npos) << said;
    ASSERT_EQ(said.rfind(file + ":", 0), 0u) << said;
    // The line of the change; of the next or previous where a line was taken out or doubled, of line 1 where the key of
    // the whole file is missing, of the entry that comes second where two clash.
    const int line = std::stoi(said.substr(file.size() + 1));
    const std::string whole = one.to;
    const std::string reason = said;
    if (reason.find("second time") != std::string::npos || reason.find("given twice") != std::string::npos) {
      EXPECT_GE(line, line_of(kSmall, at)) << said;
      EXPECT_LE(line, line_of(kSmall, at) + 1) << said;
    } else if (reason.find("the datasheet lacks") != std::string::npos) {
      EXPECT_EQ(line, 1) << said;
    } else if (std::string(one.from).find("branches: [a, b]\n") != std::string::npos) {
      EXPECT_EQ(line, 8) << said;  // the first entry that needs them
    } else {
      EXPECT_EQ(line, line_of(kSmall, at)) << said;
    }
  }
}

// Every mapping of the small datasheet, which has every key of the schema: a value that is itself a mapping with a word
// and a mapping in it is right nowhere.
TEST_F(SmallDatasheet, EveryKeyRefusesWhatIsWrongEverywhere) {
  int keys = 0;
  const auto mutate = [&](auto&& self, const YAML::Node& whole, YAML::Node node, const std::string& path) -> void {
    if (node.IsSequence()) {
      for (std::size_t i = 0; i < node.size(); ++i) self(self, whole, node[i], path + fmt::format("[{}]", i));
      return;
    }
    if (!node.IsMap()) return;
    std::vector<std::string> names;
    for (const auto& pair : node) names.push_back(pair.first.Scalar());
    for (const std::string& name : names) {
      const std::string here = path.empty() ? name : path + "." + name;
      if (here.rfind("controllers", 0) == 0 && here.find("meaning") == std::string::npos) continue;  // any setting
      const YAML::Node right = YAML::Clone(node[name]);
      node[name] = YAML::Load("{wrong: here, {x: y}: 1}");
      YAML::Emitter out;
      out << whole;
      const std::string file = write(out.c_str());
      node[name] = right;
      const std::string said = complaint([&] { read_datasheet(file); });
      SCOPED_TRACE(here);
      ++keys;
      ASSERT_EQ(said.rfind(file + ":", 0), 0u) << said;
      EXPECT_GT(std::atoi(said.c_str() + file.size() + 1), 0) << said;
      EXPECT_NE(said.find(name), std::string::npos) << said;
      EXPECT_EQ(said.find('\n'), std::string::npos) << said;
      self(self, whole, node[name], here);
    }
  };
  const YAML::Node whole = YAML::Load(kSmall);
  mutate(mutate, whole, whole, "");
  EXPECT_EQ(keys, 208);  // of the schema, as kSmall uses them
}

TEST_F(SmallDatasheet, FilesThatAreNoDatasheetsAreRefusedInOneLine) {
  const auto said = [&](const std::string& text) {
    const std::string file = write(text);
    const std::string message = complaint([&] { read_datasheet(file); });
    EXPECT_EQ(message.rfind(file + ":", 0), 0u) << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    return message.substr(message.empty() ? 0 : file.size());
  };
  EXPECT_NE(said("").find("empty"), std::string::npos);
  EXPECT_NE(said("# only a comment\n").find("empty"), std::string::npos);
  EXPECT_NE(said("just words").find("must be a mapping"), std::string::npos);
  EXPECT_NE(said("- 1\n- 2\n").find("must be a mapping"), std::string::npos);
  EXPECT_EQ(said("rig: tank\ntitle: [open\n").substr(0, 3), ":3:");
  EXPECT_EQ(said("rig: tank\n  title: x\n").substr(0, 3), ":2:");
  EXPECT_EQ(said("rig: *nothing\n").substr(0, 3), ":1:");
  EXPECT_NE(said(std::string(kSmall) + "---\nrig: two\n").find("second document"), std::string::npos);
  EXPECT_NE(said(std::string("\0\1\2\3", 4)).size(), 0u);
  EXPECT_NE(complaint([&] { read_datasheet((folder_ / "none.yaml").string()); }).find("no such file"),
            std::string::npos);
  EXPECT_NE(complaint([&] { read_datasheet(folder_.string()); }).find("no such file"), std::string::npos);
}

TEST_F(SmallDatasheet, FoldersAreCheckedForRigsThatClash) {
  write(kSmall, "tank/rig.yaml");
  EXPECT_EQ(find_datasheet(folder_.string(), "tank").rig, "tank");
  write(kSmall, "barrel/rig.yaml");
  EXPECT_NE(complaint([&] { read_datasheets(folder_.string()); }).find("already described"), std::string::npos);
  EXPECT_NE(complaint([&] { find_datasheet(folder_.string(), "barrel"); }).find("name its folder tank"),
            std::string::npos);
  EXPECT_NE(complaint([&] { find_datasheet(folder_.string(), "pond"); }).find("barrel, tank"), std::string::npos);
}

TEST_F(SmallDatasheet, ATornFileIsRefusedOrReadButNeverWorse) {
  std::ifstream stream(config_folder() + "/cooling_circuit/rig.yaml");
  const std::string whole((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
  ASSERT_GT(whole.size(), 10000u);
  int refused = 0;
  for (std::size_t size = 0; size < whole.size(); size += 487) {
    const std::string file = write(whole.substr(0, size));
    EXPECT_NO_THROW({
      try {
        read_datasheet(file);
      } catch (const InputError&) {
        ++refused;
      }
    }) << size;
  }
  EXPECT_GT(refused, 20);
}

// ---- Settings

TEST(Settings, GivesWhatIsThereAndRefusesTheRest) {
  const Settings settings("file.yaml:3: 'x'", {{"gain", 2}, {"odd", std::numeric_limits<double>::infinity()}},
                          {{"list", {1, 2, 3}}}, {{"word", "fast"}});
  EXPECT_DOUBLE_EQ(settings.number("gain", 0, 10), 2);
  EXPECT_DOUBLE_EQ(settings.number_or("none", 7, 0, 10), 7);
  EXPECT_EQ(settings.list("list", 3, 0, 5).size(), 3u);
  EXPECT_EQ(settings.word_or("none", "slow"), "slow");
  EXPECT_FALSE(settings.has("none"));
  for (const std::string& said :
       {complaint([&] { settings.number("gain", 3, 10); }), complaint([&] { settings.number("none", 0, 1); }),
        complaint([&] { settings.number("odd", 0, 1e300); }), complaint([&] { settings.number("word", 0, 1); }),
        complaint([&] { settings.list("list", 2, 0, 5); }), complaint([&] { settings.list("list", 3, 0, 2); }),
        complaint([&] { settings.list("gain", 1, 0, 2); }), complaint([&] { settings.word("gain"); }),
        complaint([&] { settings.word("none"); }), complaint([&] { settings.list("none", 1, 0, 1); })})
    EXPECT_EQ(said.rfind("file.yaml:3: 'x': ", 0), 0u) << said;
}

TEST(Settings, NamesTheKeyThatNobodyAskedFor) {
  Settings settings("here", {{"gain", 2}, {"gian", 3}}, {}, {});
  settings.number("gain", 0, 10);
  const std::string said = complaint([&] { settings.check_used(); });
  EXPECT_NE(said.find("'gian'"), std::string::npos) << said;
  EXPECT_NE(said.find("gain"), std::string::npos) << said;
  settings.number("gian", 0, 10);
  EXPECT_NO_THROW(settings.check_used());
  settings.set("gain", 5);
  EXPECT_DOUBLE_EQ(settings.number("gain", 0, 10), 5);
}

}  // namespace
}  // namespace faultline
