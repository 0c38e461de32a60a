// Every effect at every port of the control valve: it acts, stays finite over its whole range, and does to the
// equations what the datasheet says, in numbers worked out by hand.
#include <gtest/gtest.h>

#include <algorithm>

#include "rigs/control_valve/air_flow.h"
#include "rigs/control_valve/runs.h"

namespace faultline {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kAir = 101325;
constexpr double kHeat = 287 * 293.15;
const double kRoot = std::sqrt(2 / kHeat);
constexpr double kPrestageVolume = 1.5e-6 + 3e-4 * 0.6e-3;
constexpr double kCylinderVolume = 0.4e-3 + 0.0201 * 0.0388;
const double kCrank = 0.0776 / std::sqrt(2.0);  // 1/phi' at mid-stroke, m

// An effect at the low or the high end of the datasheet's range.
EffectSpec at_end(const Port& port, const FittingEffect& fitting, bool high) {
  EffectSpec spec;
  spec.effect = fitting.effect;
  spec.port = port.name;
  for (const EffectParameter& p : find_effect_type(fitting.effect)->parameters) {
    const auto bounds = fitting.bounds.find(p.name);
    spec.parameters.push_back(bounds == fitting.bounds.end()                  ? not_given(p)
                              : high && std::isfinite(bounds->second.maximum) ? bounds->second.maximum
                                                                              : bounds->second.minimum);
  }
  if (spec.effect == "stuck") spec.parameters[0] = high ? 5 : 1;
  return spec;
}

TEST(ControlValveEffects, AllActAndStayFiniteAtBothEndsOfTheirRanges) {
  const Recording plain = simulate(valve(), valve_setup("steps"), 30);
  int count = 0;
  for (const Port& port : valve().ports)
    for (const FittingEffect& fitting : port.effects)
      for (const bool high : {false, true}) {
        SimulationSetup setup = valve_setup("steps");
        setup.effects = {at_end(port, fitting, high)};
        const Recording r = simulate(valve(), setup, 30);
        double apart = 0;
        for (std::size_t k = 0; k < r.rows(); ++k)
          for (std::size_t c = 0; c < r.columns(); ++c) {
            ASSERT_TRUE(std::isfinite(r.at(k, c))) << to_string(setup.effects[0]);
            const Channel& channel = r.channels[c];
            if (channel.role == Role::output)
              apart = std::max(apart, std::abs(r.at(k, c) - plain.at(k, c)) / channel.noise_std);
          }
        EXPECT_GT(apart, high ? 1.0 : 0.02) << to_string(setup.effects[0]);
        ++count;
      }
  EXPECT_EQ(count, 2 * 50);
}

// How much a rate changes with an effect, all else equal.
double change(
    const std::string& effect, int rate, const std::function<void(ValveRig&)>& set = [](ValveRig&) {}) {
  ValveRig plain, with({effect});
  set(plain);
  set(with);
  return with.rates()[static_cast<std::size_t>(rate)] - plain.rates()[static_cast<std::size_t>(rate)];
}

TEST(ControlValveEffects, BlockagesTakeTheirShareOfTheFlow) {
  const double in = air_flow(0.9 * kPi / 4 * 0.33e-3 * 0.33e-3, 5e5 + kAir, 3e5 + kAir, kRoot);
  const double cd = 0.9467 + (0.8067 - 0.9467) * 15.0 / 35;
  const double out = air_flow(cd * kPi * 0.8e-3 * 50e-6, 3e5 + kAir, kAir, kRoot);
  const double gain = 1.4 / kPrestageVolume * kHeat;
  EXPECT_NEAR(change("clogging@restriction.fixed_restrictor:fraction=0.08", ValveRig::kPrestage), -0.08 * in * gain, 1);
  EXPECT_NEAR(change("clogging@restriction.nozzle:fraction=0.08", ValveRig::kPrestage), 0.08 * out * gain, 1);
}

TEST(ControlValveEffects, LeaksFollowTheOrificeLaw) {
  // C A = coefficient sqrt(1.2/2): 1e-8 is a hole of 0.1 mm.
  const double area = 1e-8 * std::sqrt(0.6);
  EXPECT_NEAR(std::sqrt(4 * area / kPi), 1.0e-4, 3e-6);
  EXPECT_NEAR(change("orifice_leakage@flow.prestage_ambient:coefficient=1e-8", ValveRig::kPrestage),
              -1.4 / kPrestageVolume * kHeat * air_flow(area, 3e5 + kAir, kAir, kRoot), 1e-3);
  const double p = 38660 * 0.0905 / 0.0201;
  EXPECT_NEAR(change("orifice_leakage@flow.cylinder_ambient:coefficient=8e-7", ValveRig::kCylinder),
              -1.4 / kCylinderVolume * kHeat * air_flow(80 * area, p + kAir, kAir, kRoot), 1e-3);
}

TEST(ControlValveEffects, SpoolLandsCloseOrOverlap) {
  const auto filling = [](ValveRig& v) { v.state()[ValveRig::kSpool] = 0.6; };
  ValveRig open;
  filling(open);
  const double all = open.rates()[ValveRig::kCylinder];
  ASSERT_GT(all, 0);
  EXPECT_NEAR(change("clogging@restriction.spool_ports:fraction=0.3", ValveRig::kCylinder, filling), -0.3 * all,
              1e-9 * all);
  EXPECT_NEAR(change("deadband@restriction.spool_ports:width=0.05", ValveRig::kCylinder, filling), -0.25 * all,
              1e-9 * all);
  ValveRig overlapped({"deadband@restriction.spool_ports:width=0.05"});
  overlapped.state()[ValveRig::kSpool] = 0.52;
  EXPECT_EQ(overlapped.rates()[ValveRig::kCylinder], 0);
  overlapped.state()[ValveRig::kSpool] = 0.48;
  EXPECT_EQ(overlapped.rates()[ValveRig::kCylinder], 0);
}

TEST(ControlValveEffects, SegmentIsBlockedOrBent) {
  const auto flow = [](double c) { return 0.865 * 90 * c * std::sqrt(6 * 0.3 / (0.3 + 0.7 * c * c)) / 3600; };
  const auto c = [](double h) { return 0.15 * h + 0.85 * h * h * h; };
  ValveRig blocked({"clogging@restriction.process_valve:fraction=0.1"});
  EXPECT_NEAR(blocked.shows("flow"), flow(0.9 * c(0.5)), 1e-12);
  ValveRig bent({"area_curve@restriction.process_valve:exponent=1.1"});
  EXPECT_NEAR(bent.shows("flow"), flow(c(std::pow(0.5, 1.1))), 1e-12);
  ValveRig both(
      {"area_curve@restriction.process_valve:exponent=1.1", "clogging@restriction.process_valve:fraction=0.1"});
  EXPECT_NEAR(both.shows("flow"), flow(0.9 * c(std::pow(0.5, 1.1))), 1e-12);
}

TEST(ControlValveEffects, CompressibilityScalesTheCylindersRate) {
  const auto filling = [](ValveRig& v) { v.state()[ValveRig::kSpool] = 0.6; };
  ValveRig open;
  filling(open);
  EXPECT_NEAR(change("compliance_factor@compliance.cylinder:factor=0.8", ValveRig::kCylinder, filling),
              -0.2 * open.rates()[ValveRig::kCylinder], 1e-6);
}

TEST(ControlValveEffects, FrictionWidensTheBands) {
  const auto pushed = [](double force) {
    return [force](ValveRig& v) { v.state()[ValveRig::kCylinder] = (38660 * 0.0905 + force) / 0.0201; };
  };
  const double per_newton = 1 / 2000.0 / kCrank / (kPi / 2);
  const auto actuator = [&](const std::string& effect, double force) {
    return change(effect, ValveRig::kPiston, pushed(force)) / per_newton;
  };
  EXPECT_NEAR(actuator("coulomb_friction@force.actuator:force=100", 400), -100, 1e-6);
  EXPECT_NEAR(actuator("coulomb_friction@force.actuator:force=100", -800), 100, 1e-6);
  EXPECT_NEAR(actuator("asymmetric_friction@force.actuator:difference=100", 400), -50, 1e-6);
  EXPECT_NEAR(actuator("asymmetric_friction@force.actuator:difference=100", -800), -50, 1e-6);
  EXPECT_NEAR(actuator("load_force@force.actuator:constant=60,stiffness=4000", 400), -60,
              1e-6);  // none of it at mid-stroke
  EXPECT_NEAR(actuator("viscous_friction@force.actuator:coefficient=2000", 550), -200, 1e-6);  // half the speed
  const auto spool = [](const std::string& effect, double force) {
    return 120 * 1.2e-3 *
           change(effect, ValveRig::kSpool, [&](ValveRig& v) { v.state()[ValveRig::kPrestage] = 3e5 + force / 3e-4; });
  };
  EXPECT_NEAR(spool("coulomb_friction@force.spool:force=2", 5), -2, 1e-9);
  EXPECT_NEAR(spool("coulomb_friction@force.spool:force=2", -5), 2, 1e-9);
  EXPECT_NEAR(spool("load_force@force.spool:constant=1,stiffness=4000", 5), -1, 1e-9);
}

TEST(ControlValveEffects, AsymmetricFrictionIsHalfAsMuchLoad) {
  // The datasheet's exact equivalence.
  for (const auto& [friction, load] :
       {std::pair{"asymmetric_friction@force.spool:difference=6", "load_force@force.spool:constant=3,stiffness=0"},
        {"asymmetric_friction@force.actuator:difference=400", "load_force@force.actuator:constant=200,stiffness=0"}}) {
    const Recording a = simulate(valve(), valve_setup("steps", {friction}), 20);
    const Recording b = simulate(valve(), valve_setup("steps", {load}), 20);
    for (std::size_t i = 0; i < a.values.size(); ++i)
      ASSERT_NEAR(a.values[i], b.values[i], 1e-9 * std::max(1.0, std::abs(a.values[i])));
  }
}

TEST(ControlValveEffects, SealFrictionAddsToTheTorque) {
  const auto opening = [](ValveRig& v) { v.state()[ValveRig::kCylinder] = (38660 * 0.0905 + 250) / 0.0201; };
  const double turning = 0.05 / kCrank;
  EXPECT_NEAR(change("coulomb_friction@force.valve:force=20", ValveRig::kTorque, opening), turning * 20 / 0.01, 1e-6);
  const double c = 0.15 * 0.5 + 0.85 * 0.125, drop = 6e5 * 0.3 / (0.3 + 0.7 * c * c);
  EXPECT_NEAR(change("load_dependent_friction@force.valve:coefficient=2e-5", ValveRig::kTorque, opening),
              turning * 2e-5 * drop / 0.01, 1e-6);
}

TEST(ControlValveEffects, HysteresisOfTheDiaphragmsIsALoopOfItsWidth) {
  // Over +-10 % of the stroke, twice the elastic reach, the force ends at half the width on either side.
  ValveRig v({"hysteresis@force.spool:width=6"});
  v.state()[ValveRig::kPrestage] = 3.6e5;
  const auto force = [&](double spool) {
    v.state()[ValveRig::kSpool] = spool;
    return v.rates()[ValveRig::kSpool] * 1.2e-3 * 120 + 0.4 - 3e-4 * 3.6e5 + 65 + 1e4 * (1.2e-3 * spool + 1e-4) +
           3e4 * 1.2e-3 * spool;
  };
  EXPECT_NEAR(force(0.5), 0, 1e-9);
  EXPECT_NEAR(force(0.525), -1.5, 1e-9);
  EXPECT_NEAR(force(0.6), -3, 1e-9);
  EXPECT_NEAR(force(0.4), 3, 1e-9);
}

TEST(ControlValveEffects, PlayLosesItsGapAndLetsGoOfTheValve) {
  // Up and down: the valve follows by a gap later, and inside the play its torque is 0.
  const double gap = 0.004;
  ValveRig v({fmt::format("backlash@transmission.linkage:gap={}", gap)});
  const auto travel = [&] { return 0.0388 + kCrank * std::sin(v.state()[ValveRig::kPiston] * kPi / 2 - kPi / 4); };
  const auto driven = [&] { return 0.0388 + kCrank * std::sin(v.shows("valve_position") * kPi / 2 - kPi / 4); };
  v.at("coil_voltage") = 2.3;
  v.run(0.4);
  EXPECT_NEAR(travel() - driven(), gap / 2, 1e-9);
  EXPECT_GT(v.shows("load_torque"), 11);
  const double highest = v.shows("valve_position");
  v.at("coil_voltage") = 1.6;
  int inside = 0;
  v.run(2, [&] {
    const double lost = travel() - driven();
    ASSERT_LE(std::abs(lost), gap / 2 + 1e-9);
    if (std::abs(lost) < gap / 2 - 1e-5) {
      ++inside;
      ASSERT_EQ(v.shows("load_torque"), 0);
      ASSERT_NEAR(v.shows("valve_position"), highest, 0.03);  // moved on before the piston turned
    }
  });
  EXPECT_GT(inside, 20);
  EXPECT_NEAR(travel() - driven(), -gap / 2, 1e-9);
  EXPECT_LT(v.shows("load_torque"), -11);
}

TEST(ControlValveEffects, PlayThatGrowsFromNothingStartsAsATightJoint) {
  const Recording tight = simulate(valve(), valve_setup("multisine"), 10);
  const Recording growing =
      simulate(valve(), valve_setup("multisine", {"backlash@transmission.linkage:gap=0.004,from=9,to=20"}), 10);
  for (std::size_t k = 0; k < 900; ++k)
    for (std::size_t c = 0; c < tight.columns(); ++c) {
      if (tight.channels[c].role != Role::output) continue;
      ASSERT_NEAR(growing.at(k, c), tight.at(k, c), 0.05 * tight.channels[c].noise_std) << tight.channels[c].name << k;
    }
}

TEST(ControlValveEffects, JointTwistsByItsTorque) {
  // Without damping at once; with it by a first-order lag of compliance times damping.
  for (const double damping : {0.0, 5.0}) {
    ValveRig v({fmt::format("elasticity@transmission.linkage:compliance=0.0015,damping={}", damping)});
    v.at("coil_voltage") = 2.2;
    v.run(0.5);
    const double twist = (v.state()[ValveRig::kPiston] - v.shows("valve_position")) * kPi / 2;
    EXPECT_GT(v.shows("load_torque"), 11);
    const double lag = 0.0015 * v.shows("load_torque") - twist;
    EXPECT_NEAR(lag, 0, damping > 0 ? 3e-4 : 1e-12);
    EXPECT_EQ(lag > 1e-4, damping > 0);
  }
}

TEST(ControlValveEffects, FrictionThatFallsWithSpeedSticksAndSlips) {
  // Breakaway at 150 + 300 N; then at once as fast as 150 N let it. Sticks again where no speed is in balance.
  ValveRig v({"stribeck_friction@force.actuator:static_excess=300,velocity=0.005"});
  const auto push = [&](double force) { v.state()[ValveRig::kCylinder] = (38660 * 0.0905 + force) / 0.0201; };
  const auto speed = [&] { return v.rates()[ValveRig::kPiston] * kCrank * kPi / 2; };
  const auto settle = [&] { v.rig->after_step(0, v.state(), v.channels.data()); };
  push(440);
  settle();
  EXPECT_EQ(speed(), 0);
  push(460);
  settle();
  EXPECT_NEAR(speed(), 310.0 / 2000, 1e-6);
  push(200);  // below breakaway, but it slips: 50 N less exp(-25) of the excess
  settle();
  EXPECT_NEAR(speed(), 0.025, 1e-5);
  push(155);
  settle();
  EXPECT_EQ(speed(), 0);
  push(440);
  settle();
  EXPECT_EQ(speed(), 0);
}

TEST(ControlValveEffects, SupplyDroopsByTheFlowThatItFeeds) {
  // Wide open into a low pressure: choked, so the flow is in proportion to the absolute supply.
  ValveRig v({"droop@source.supply:resistance=2e7"});
  v.state()[ValveRig::kSpool] = 1;
  v.state()[ValveRig::kCylinder] = 1e5;
  v.state()[ValveRig::kPiston] = 0;
  const double cylinder = v.rates()[ValveRig::kCylinder];
  const double flow = cylinder * 0.4e-3 / 1.4 / kHeat;  // the piston is held by its spring
  const double supply = 5e5 - 2e7 * flow;
  const double ratio = (1e5 + kAir) / (supply + kAir);
  ASSERT_LT(ratio, 0.5);
  const double cd = 0.6133 + (0.6033 - 0.6133) * (ratio - 0.25) / 0.25;
  EXPECT_NEAR(flow, air_flow(cd * 7e-6, supply + kAir, 1e5 + kAir, kRoot), 1e-5 * flow);
  EXPECT_LT(supply, 4.5e5);
  v.state()[ValveRig::kSpool] = 0.3;  // nothing is drawn
  ValveRig plain;
  plain.state()[ValveRig::kSpool] = 0.3;
  EXPECT_DOUBLE_EQ(v.rates()[ValveRig::kPrestage], plain.rates()[ValveRig::kPrestage]);
}

TEST(ControlValveEffects, SupplyOffsetReachesAllOfTheDevice) {
  ValveRig v({"offset@source.supply:value=-5e4"}), lower({}, 4.5e5);
  std::copy_n(v.state(), 6, lower.state());
  EXPECT_EQ(v.rates(), lower.rates());
}

TEST(ControlValveEffects, PlayKeepsItsPlaceAtARestart) {
  // Segments put the states back: the valve stays at the flank on which it was.
  ValveRig v({"backlash@transmission.linkage:gap=0.004"});
  v.at("coil_voltage") = 2.3;
  v.run(0.4);
  const double before = v.shows("valve_position"), torque = v.shows("load_torque");
  v.rig->set_modes(v.state());
  EXPECT_EQ(v.shows("valve_position"), before);
  EXPECT_EQ(v.shows("load_torque"), torque);
}

}  // namespace
}  // namespace faultline
