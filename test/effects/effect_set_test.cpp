// The effects of a rig by port: what is refused, how they chain, how they grow, and that a seed fixes them.
#include <gtest/gtest.h>

#include <cmath>

#include <string>
#include <vector>

#include "faultline/rig/effect_chain.h"
#include "faultline/rig/effect_unit.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

Port port_with(const std::string& name, const std::vector<std::string>& effects, double range = 1) {
  Port port;
  port.name = name;
  port.kind = port_kind(name);
  port.range = range;
  if (port.kind == PortKind::command || port.kind == PortKind::sensor) port.channel = name.substr(name.find('.') + 1);
  for (const auto& effect : effects) port.effects.push_back({effect, {}});
  return port;
}

Datasheet bench() {
  Datasheet sheet;
  sheet.rig = "bench";
  sheet.ports.push_back(port_with("command.valve", {"scale", "offset", "rate_limit", "gain_curve", "deadband"}, 10));
  sheet.ports.push_back(port_with("sensor.position", {"drift", "noise", "stuck", "lag"}));
  sheet.ports.push_back(port_with("sensor.velocity", {"noise"}));
  sheet.ports.push_back(port_with("force.piston", {"coulomb_friction", "viscous_friction"}));
  sheet.ports.push_back(port_with("source.supply", {"drift"}));
  return sheet;
}

std::vector<EffectSpec> specs(const std::vector<std::string>& texts) {
  std::vector<EffectSpec> parsed;
  for (const auto& text : texts) parsed.push_back(parse_effect(text));
  return parsed;
}

std::string refusal(const std::string& text) {
  try {
    EffectSet(bench(), specs({text}), 1e-3, 1);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(EffectSet, RefusesWhatTheRigDoesNotHave) {
  const std::string no_port = refusal("scale@command.pump:factor=1.1");
  EXPECT_NE(no_port.find("bench has no port 'command.pump'"), std::string::npos) << no_port;
  EXPECT_NE(no_port.find("command.valve, sensor.position"), std::string::npos) << no_port;
  const std::string no_fit = refusal("stuck@command.valve:from=1");
  EXPECT_NE(no_fit.find("stuck does not fit command.valve of bench"), std::string::npos) << no_fit;
  EXPECT_NE(no_fit.find("scale, offset, rate_limit"), std::string::npos) << no_fit;
  EXPECT_EQ(refusal("scale@command.valve:factor=1.1"), "");
}

TEST(EffectSet, RefusesASpecThatNoTextCouldGive) {
  EffectSpec spec = parse_effect("scale@command.valve:factor=1.1");
  spec.parameters.clear();
  EXPECT_THROW(check_effect(bench(), spec), InputError);
  spec.effect = "no_such_effect";
  EXPECT_THROW(check_effect(bench(), spec), InputError);
}

TEST(EffectSpec, SwellsComeAndGoWithinTheirTime) {
  const EffectSpec spec = parse_effect("scale@command.valve:factor=1.1,from=30,to=50,swells=2");
  EXPECT_EQ(growth(spec, 29), 0);
  EXPECT_NEAR(growth(spec, 32.5), 0.5, 1e-12);
  EXPECT_NEAR(growth(spec, 35), 1, 1e-12);
  EXPECT_NEAR(growth(spec, 40), 0, 1e-12);
  EXPECT_NEAR(growth(spec, 46), 0.5 * (1 - std::cos(2 * 3.14159265358979323846 * 1.6)), 1e-12);
  EXPECT_EQ(growth(spec, 50), 0);
  EXPECT_EQ(growth(spec, 60), 0);
  EXPECT_EQ(to_string(spec), "scale@command.valve:factor=1.1,from=30,to=50,swells=2");
  for (const char* wrong : {"from=1,to=2,swells=0", "from=1,to=2,swells=1.5", "from=1,swells=1", "to=2,swells=1",
                            "from=1,to=2,swells=many", "from=1,to=2,swells=1e9"})
    EXPECT_THROW(parse_effect(std::string("scale@command.valve:factor=1.1,") + wrong), InputError) << wrong;
}

TEST(EffectSet, EmptyPortChangesNothing) {
  const EffectSet set(bench(), {}, 1e-3, 1);
  EXPECT_TRUE(set.at("command.valve").empty());
  EXPECT_EQ(set.at("command.valve").signal(3, 0), 3);
  EXPECT_EQ(set.at("force.piston").forces({0, 1, 0}).viscous, 0);
}

TEST(EffectSet, ChainsInTheGivenOrderAndUndoesBackwards) {
  const EffectSet set(bench(), specs({"scale@command.valve:factor=2", "offset@command.valve:value=1"}), 1e-3, 1);
  EXPECT_DOUBLE_EQ(set.at("command.valve").signal(3, 0), 7);
  EXPECT_DOUBLE_EQ(set.at("command.valve").undo_signal(7, 0), 3);
  const EffectSet other(bench(), specs({"offset@command.valve:value=1", "scale@command.valve:factor=2"}), 1e-3, 1);
  EXPECT_DOUBLE_EQ(other.at("command.valve").signal(3, 0), 8);
  EXPECT_DOUBLE_EQ(other.at("command.valve").undo_signal(8, 0), 3);
}

TEST(EffectSet, SumsForces) {
  const EffectSet set(bench(),
                      specs({"coulomb_friction@force.piston:force=30", "viscous_friction@force.piston:coefficient=10",
                             "coulomb_friction@force.piston:force=5"}),
                      1e-3, 1);
  const BodyForces forces = set.at("force.piston").forces({0, 2, 0});
  EXPECT_EQ(forces.sliding_plus, 35);
  EXPECT_EQ(forces.viscous, 20);
}

TEST(EffectSet, PassesRangeAndStep) {
  const EffectSet curve(bench(), specs({"gain_curve@command.valve:curvature=0.4"}), 1e-3, 1);
  EXPECT_DOUBLE_EQ(curve.at("command.valve").signal(5, 0), 4);  // range 10
  const EffectSet limit(bench(), specs({"rate_limit@command.valve:rate=10"}), 0.02, 1);
  limit.at("command.valve").signal(0, 0);
  EXPECT_DOUBLE_EQ(limit.at("command.valve").signal(1, 0.02), 0.2);
}

TEST(EffectSet, GrowsWithTime) {
  EffectSet set(bench(), specs({"offset@command.valve:value=2,from=10,to=20", "scale@command.valve:factor=3,from=30"}),
                1e-3, 1);
  const auto at = [&](double time) {
    set.set_time(time);
    return set.at("command.valve").signal(1, time);
  };
  EXPECT_DOUBLE_EQ(at(0), 1);
  EXPECT_DOUBLE_EQ(at(10), 1);
  EXPECT_DOUBLE_EQ(at(15), 2);
  EXPECT_DOUBLE_EQ(at(20), 3);
  EXPECT_DOUBLE_EQ(at(29.9), 3);
  EXPECT_DOUBLE_EQ(at(30), 9);
  set.reset();
  EXPECT_DOUBLE_EQ(set.at("command.valve").signal(1, 0), 1);
}

// A leak of a rig whose levels are volts: laminar below a thousandth of the port's range, and told in its own unit.
TEST(EffectSet, LeaksInTheUnitsOfTheirPort) {
  Datasheet sheet = bench();
  Port port = port_with("flow.tank_sump", {"orifice_leakage"}, 10);
  sheet.ports.push_back(port);
  EXPECT_EQ(effect_unit(sheet, port, "m^3/(s sqrt(Pa))"), "m^3/(s sqrt(Pa))");
  const auto texts = specs({"orifice_leakage@flow.tank_sump:coefficient=0.02"});
  const LeakPath full{9, 9, 0};
  EXPECT_NEAR(EffectSet(sheet, texts, 4, 1).at("flow.tank_sump").flow(full), 0.02 * 9 / std::sqrt(1000), 1e-6);
  sheet.ports.back().drop_unit = port.drop_unit = "V";
  sheet.ports.back().unit = port.unit = "V/s";
  EXPECT_NEAR(EffectSet(sheet, texts, 4, 1).at("flow.tank_sump").flow(full), 0.06, 1e-7);
  EXPECT_EQ(effect_unit(sheet, port, "m^3/(s sqrt(Pa))"), "V/(s sqrt(V))");
  EXPECT_EQ(effect_unit(sheet, port, "m^3/(s Pa)"), "V/(s V)");
  EXPECT_EQ(effect_unit(sheet, port, "Pa"), "V");
  port.unit = "kg/s";
  port.drop_unit.clear();
  EXPECT_EQ(effect_unit(sheet, port, "m^3/(s sqrt(Pa))"), "kg/(s sqrt(Pa))");
}

// A shaft on a rig that slides.
TEST(EffectSet, SizesInUnitsOfTheirOwn) {
  Datasheet sheet = bench();
  Port port = port_with("force.shaft", {"coulomb_friction", "viscous_friction"}, 10);
  const EffectType& dry = *find_effect_type("coulomb_friction");
  EXPECT_EQ(parameter_unit(sheet, port, dry, dry.parameters[0]), "N");
  port.units["coulomb_friction.force"] = "N m";
  EXPECT_EQ(parameter_unit(sheet, port, dry, dry.parameters[0]), "N m");
  const EffectType& smooth = *find_effect_type("viscous_friction");
  EXPECT_EQ(parameter_unit(sheet, port, smooth, smooth.parameters[0]), "N s/m");
}

TEST(EffectSet, DriftStartsAtItsTimeWithoutAJump) {
  EffectSet set(bench(), specs({"drift@sensor.position:rate=0.5,from=4,to=8", "drift@source.supply:rate=100"}), 1e-3,
                1);
  const auto at = [&](double time) {
    set.set_time(time);
    return set.at("sensor.position").signal(0, time);
  };
  EXPECT_EQ(at(0), 0);
  EXPECT_EQ(at(4), 0);
  EXPECT_DOUBLE_EQ(at(5), 0.5);
  EXPECT_DOUBLE_EQ(at(10), 3);
  EXPECT_DOUBLE_EQ(set.at("source.supply").boundary(1000, 0, 10), 2000);
  // A run that is entered in the middle sees the same drift.
  EffectSet late(bench(), specs({"drift@sensor.position:rate=0.5,from=4"}), 1e-3, 1);
  late.set_time(10);
  EXPECT_DOUBLE_EQ(late.at("sensor.position").signal(0, 10), 3);
}

TEST(EffectSet, StuckTakesFromAsItsOwn) {
  EffectSet set(bench(), specs({"stuck@sensor.position:from=2"}), 1, 1);
  std::vector<double> out;
  for (int k = 0; k < 5; ++k) {
    set.set_time(k);
    out.push_back(set.at("sensor.position").signal(10 + k, k));
  }
  EXPECT_EQ(out, (std::vector<double>{10, 11, 11, 11, 11}));
}

TEST(EffectSet, SeedFixesNoiseAndKeepsPortsApart) {
  const auto texts = specs({"noise@sensor.position:std=1", "noise@sensor.velocity:std=1"});
  EffectSet set(bench(), texts, 1e-3, 5), same(bench(), texts, 1e-3, 5), other(bench(), texts, 1e-3, 6);
  std::vector<double> first;
  int equal_ports = 0, equal_seeds = 0;
  for (int k = 0; k < 100; ++k) {
    const double a = set.at("sensor.position").signal(0, 0);
    first.push_back(a);
    EXPECT_EQ(same.at("sensor.position").signal(0, 0), a);
    if (set.at("sensor.velocity").signal(0, 0) == a) ++equal_ports;
    if (other.at("sensor.position").signal(0, 0) == a) ++equal_seeds;
  }
  EXPECT_EQ(equal_ports, 0);
  EXPECT_EQ(equal_seeds, 0);
  set.reset();
  for (double a : first) EXPECT_EQ(set.at("sensor.position").signal(0, 0), a);
}

}  // namespace
}  // namespace faultline
