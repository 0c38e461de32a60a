// The nominal valve: air through its orifices, where it comes to rest, friction, linkage and flow, against numbers that
// were worked out by hand from the datasheet, and what the thesis prints. Trajectories: test_equations.py.
#include <gtest/gtest.h>

#include <algorithm>

#include "faultline/rig/driven_model.h"
#include "rigs/control_valve/air_flow.h"
#include "rigs/control_valve/runs.h"

namespace faultline {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kAir = 101325;         // Pa
constexpr double kHeat = 287 * 293.15;  // R T, J/kg
const double kRoot = std::sqrt(2 / kHeat);

TEST(AirFlow, ChokedSubsonicAndLaminarBranches) {
  EXPECT_DOUBLE_EQ(flow_function(0), 0.484178);
  EXPECT_DOUBLE_EQ(flow_function(0.528), 0.484178);
  // The power comes from cubics.
  for (double r = 0.53; r < 0.99; r += 0.0037)
    EXPECT_NEAR(flow_function(r), std::sqrt(3.5 * (std::pow(r, 10.0 / 7) - std::pow(r, 12.0 / 7))), 1e-10);
  EXPECT_NEAR(flow_function(0.7), 0.4514, 1e-4);
  EXPECT_NEAR(flow_function(0.5283), 0.484178, 1e-6);                   // no step at the critical ratio
  EXPECT_NEAR(flow_function(0.99 - 1e-12), flow_function(0.99), 1e-9);  // nor where it turns laminar
  EXPECT_NEAR(flow_function(0.995), 0.5 * flow_function(0.99), 1e-12);
  EXPECT_EQ(flow_function(1), 0);
}

TEST(AirFlow, FlowsBothWaysAndInProportion) {
  // 1 mm^2 at 6 bar absolute, choked: 1e-6 * 6e5 * 0.484178 * 4.8757e-3 = 1.4164 g/s.
  EXPECT_NEAR(air_flow(1e-6, 6e5, 1e5, kRoot), 1.4164e-3, 1e-7);
  EXPECT_DOUBLE_EQ(air_flow(2e-6, 6e5, 1e5, kRoot), 2 * air_flow(1e-6, 6e5, 1e5, kRoot));
  EXPECT_DOUBLE_EQ(air_flow(1e-6, 3e5, 5e5, kRoot), -air_flow(1e-6, 5e5, 3e5, kRoot));
  EXPECT_EQ(air_flow(1e-6, 3e5, 3e5, kRoot), 0);
}

TEST(ControlValve, StartsInBalance) {
  ValveRig v;
  // A_s P_S + k_ss (X + x_pre) + k_d X = 65 + 7 + 18 N over 3 cm^2; spring of 38660 N/m at 0.0388 + 0.0517 m.
  EXPECT_NEAR(v.state()[ValveRig::kPrestage], 3.0e5, 1);
  EXPECT_NEAR(v.state()[ValveRig::kCylinder], 38660 * 0.0905 / 0.0201, 1);
  EXPECT_EQ(v.state()[ValveRig::kTorque], 0);
  v.at("flow_setpoint") = 0.01;
  v.rig->start(v.channels.data(), v.state());
  EXPECT_NEAR(v.shows("flow"), 0.01, 1e-9);
  v.at("flow_setpoint") = 0;
  v.at("valve_setpoint") = 0.3;
  v.rig->start(v.channels.data(), v.state());
  EXPECT_NEAR(v.shows("valve_position"), 0.3, 1e-12);
}

TEST(ControlValve, FlowOfTheLiquidIsThatOfTheDatasheet) {
  // Wide open dp = 0.3 * 6 bar: 0.865 * 90 * sqrt(1.8)/3600 m^3/s.
  for (const auto& [opening, flow] :
       {std::pair{1.0, 0.865 * 90 * std::sqrt(1.8) / 3600}, {0.5, 0.00925277}, {0.0, 0.0}}) {
    ValveRig v;
    v.state()[ValveRig::kPiston] = opening;
    EXPECT_NEAR(v.shows("flow"), flow, 1e-6) << opening;
  }
}

TEST(ControlValve, FlapperRangeIsTable2s) {
  // Thesis, Table 2: 15..100 um at 0.5 MPa, 30..105 um at 0.8 MPa; the datasheet's note for 0.2 MPa.
  for (const auto& [supply, low, high] : {std::tuple{2e5, 0.0, 101e-6}, {5e5, 12e-6, 103e-6}, {8e5, 30e-6, 104e-6}}) {
    for (const double voltage : {0.0, 4.5}) {
      ValveRig v({}, supply);
      v.at("coil_voltage") = voltage;
      v.run(2);
      EXPECT_NEAR(v.shows("flapper_position"), voltage > 0 ? low : high, 1e-6) << supply << " " << voltage;
    }
  }
}

TEST(ControlValve, FlapperComesToRestWhereForcesAndFlowsBalance) {
  ValveRig v;
  v.at("coil_voltage") = 1.9;
  v.run(1);
  const double x = v.state()[ValveRig::kFlapper], p = v.state()[ValveRig::kPrestage];
  const double area = kPi / 4 * std::pow(0.8e-3 + 0.4125 * 0.4e-3, 2);
  EXPECT_NEAR((1.0232 - 9473 * x) * p * area, 1.9 * 0.1 + 1500 * (x - 1e-4), 1e-9);
  const double cd = 0.9467 + (0.8067 - 0.9467) * (x - 35e-6) / 35e-6;  // between 35 and 70 um
  const double in = air_flow(0.9 * kPi / 4 * 0.33e-3 * 0.33e-3, 5e5 + kAir, p + kAir, kRoot);
  EXPECT_GT(x, 35e-6);
  EXPECT_NEAR(in, air_flow(cd * kPi * 0.8e-3 * x, p + kAir, kAir, kRoot), 1e-12);
}

TEST(ControlValve, WarmCoilPullsLess) {
  // Copper at constant voltage: 0.39 % per kelvin.
  ValveRig cold, warm({}, 5e5, 303.15);
  for (ValveRig* v : {&cold, &warm}) v->at("coil_voltage") = 2.0;
  EXPECT_NEAR(14 * (warm.rates()[0] - cold.rates()[0]), 2.0 * 0.1 * 0.039, 1e-12);
}

TEST(ControlValve, FullStrokeTakesAsLongAsItsPortsLetIt) {
  // With the spool at its stops. The datasheet's choice of the port area says 1.2 s to open, and 3.5 s to close where
  // its equations take 4.3 s.
  for (const bool opens : {true, false}) {
    ValveRig v;
    v.state()[ValveRig::kPiston] = opens ? 0 : 1;
    v.state()[ValveRig::kCylinder] = 38660 * (0.0517 + (opens ? 0 : 0.0776)) / 0.0201;
    v.at("coil_voltage") = opens ? 4.5 : 0;
    double duration = 0;
    while (duration < 10 && std::abs(v.state()[ValveRig::kPiston] - (opens ? 1 : 0)) > 1e-3) {
      v.run(0.01);
      duration += 0.01;
    }
    EXPECT_NEAR(duration, opens ? 1.23 : 4.31, 0.02);
  }
}

TEST(ControlValve, SpoolPassesAirByItsTables) {
  // Between the rows of the tables, with s = 0.7 half way from 0.6 to 0.8, and s = 0.3 half way from 0.2 to 0.4.
  ValveRig v;
  const double volume = 0.4e-3 + 0.0201 * 0.0388, p = 2e5;
  v.state()[ValveRig::kCylinder] = p;
  v.state()[ValveRig::kPiston] = 0.5;
  v.state()[ValveRig::kTorque] = (0.0201 * p - 38660 * 0.0905) * 0.0776 / std::sqrt(2.0);  // at rest
  v.state()[ValveRig::kSpool] = 0.7;
  const double ratio = (p + kAir) / (5e5 + kAir), share = (ratio - 0.5) / 0.25;
  const double fill = 0.5 * (0.42 + share * (0.35 - 0.42)) + 0.5 * (0.6033 + share * (0.54 - 0.6033));
  EXPECT_NEAR(v.rates()[ValveRig::kCylinder],
              1.4 / volume * kHeat * air_flow(fill * 7e-6 * 0.4, 5e5 + kAir, p + kAir, kRoot), 1);
  v.state()[ValveRig::kSpool] = 0.3;
  EXPECT_NEAR(v.rates()[ValveRig::kCylinder],
              -1.4 / volume * kHeat * air_flow(0.5 * (0.66 + 0.70) * 7e-6 * 0.4, p + kAir, kAir, kRoot), 1);
}

TEST(ControlValve, PistonSticksWithinTheBandOfTables9And10) {
  // At mid-stroke 150 N upwards and 540 N downwards, then as fast as 2000 N s/m let it.
  ValveRig v;
  const double speed_of_opening = 0.0776 / std::sqrt(2.0) * kPi / 2;  // m of piston per unit of opening, here
  const auto speed = [&](double force) {
    v.state()[ValveRig::kCylinder] = (38660 * 0.0905 + force) / 0.0201;
    return v.rates()[ValveRig::kPiston] * speed_of_opening;
  };
  EXPECT_EQ(speed(149), 0);
  EXPECT_EQ(speed(-539), 0);
  EXPECT_NEAR(speed(250), 100.0 / 2000, 1e-9);
  EXPECT_NEAR(speed(-740), -200.0 / 2000, 1e-9);
}

TEST(ControlValve, SpoolMovesOutsideItsBand) {
  ValveRig v;
  v.state()[ValveRig::kPrestage] = 3.0e5 + 0.3 / 3e-4;
  EXPECT_EQ(v.rates()[ValveRig::kSpool], 0);
  v.state()[ValveRig::kPrestage] = 3.0e5 + 1.6 / 3e-4;
  EXPECT_NEAR(v.rates()[ValveRig::kSpool] * 1.2e-3, 1.2 / 120, 1e-9);
}

TEST(ControlValve, SealTorqueBuildsUpOverTheWindup) {
  // At half open T_c = 0.16 * 1600 * 0.05 = 12.8 N m: from 0 with slope T_c/phi_w, and towards it.
  ValveRig v;
  v.state()[ValveRig::kCylinder] = (38660 * 0.0905 + 250) / 0.0201;
  const double turning = 0.05 / (0.0776 / std::sqrt(2.0));
  EXPECT_NEAR(v.rates()[ValveRig::kTorque], turning * 12.8 / 0.01, 1e-6);
  v.at("coil_voltage") = 2.2;
  v.run(1);
  const double opening = v.shows("valve_position");
  const double mu = opening < 0.75 ? 0.16 + (0.15 - 0.16) * (opening - 0.5) / 0.25 : 0.15;
  EXPECT_GT(opening, 0.55);
  EXPECT_NEAR(v.shows("load_torque"), mu * 1600 * 0.05, 0.05);
}

TEST(ControlValve, LinkageTurnsAQuarter) {
  // phi = pi/4 + asin((x - L/2)/(L/sqrt 2)): a quarter turn over the stroke, steepest rate 1/(L/2) at the ends.
  ValveRig v;
  v.state()[ValveRig::kPiston] = 0.25;
  v.state()[ValveRig::kCylinder] = 5e5;
  const double r = 0.0776 / std::sqrt(2.0), lever = r * std::sin(-kPi / 8);
  const double force = 0.0201 * 5e5 - 38660 * (0.0388 + lever + 0.0517);
  const double x = 0.0388 + lever,
               coulomb = 110 - 10 * x / 0.0194;  // Table 9, first to second point
  EXPECT_NEAR(v.rates()[ValveRig::kPiston], (force - coulomb) / 2000 / std::sqrt(r * r - lever * lever) / (kPi / 2),
              1e-9);
}

TEST(ControlValve, AtItsStopThePressureGoesOn) {
  for (const bool open : {true, false}) {
    ValveRig v;
    v.at("coil_voltage") = open ? 2.4 : 1.5;
    v.run(20);
    EXPECT_EQ(v.state()[ValveRig::kPiston], open ? 1 : 0);
    EXPECT_NEAR(v.state()[ValveRig::kCylinder], open ? 5e5 : 0, 1e4);
  }
}

// Just off a stop with the full force of the air or the spring towards it: a long step ends where tiny ones do.
TEST(ControlValve, ReachesItsStopsByLongStepsAsByShortOnes) {
  for (const char* effect : {"", "backlash@transmission.linkage:gap=5e-5"})
    for (const bool open : {true, false}) {
      const auto after = [&](int steps) {
        ValveRig v(*effect ? std::vector<std::string>{effect} : std::vector<std::string>());
        v.state()[ValveRig::kSpool] = 0.5;
        v.state()[ValveRig::kCylinder] = open ? 4.8e5 : 0.2e5;
        v.state()[ValveRig::kPiston] = open ? 0.9995 : 0.0005;
        v.state()[ValveRig::kTorque] = open ? 5 : -5;
        v.rig->set_modes(v.state());
        for (int i = 0; i < steps; ++i) v.integrator->step(0, 2.5e-3 / steps, v.channels.data());
        return std::vector<double>(v.state(), v.state() + v.rig->states());
      };
      const std::vector<double> coarse = after(1), fine = after(5000);
      EXPECT_EQ(coarse[ValveRig::kPiston], open ? 1 : 0);
      EXPECT_NEAR(coarse[ValveRig::kCylinder], fine[ValveRig::kCylinder], 0.1 * noise_of("cylinder_pressure"))
          << effect << open;
      EXPECT_NEAR(coarse[ValveRig::kTorque], fine[ValveRig::kTorque], 0.5 * noise_of("load_torque")) << effect << open;
    }
}

TEST(ControlValve, ItsSpoolReachesItsStopByALongStepAsByShortOnes) {
  const auto after = [](int steps) {
    ValveRig v;
    v.state()[ValveRig::kSpool] = 0.99;
    v.state()[ValveRig::kPrestage] = 4.5e5;
    for (int i = 0; i < steps; ++i) v.integrator->step(0, 2.5e-3 / steps, v.channels.data());
    return std::vector<double>(v.state(), v.state() + v.rig->states());
  };
  const std::vector<double> coarse = after(1), fine = after(5000);
  EXPECT_EQ(fine[ValveRig::kSpool], 1);
  EXPECT_EQ(coarse[ValveRig::kSpool], 1);
  // The gas of the prestage follows within a millisecond, which a step does not.
  EXPECT_NEAR(coarse[ValveRig::kPrestage], fine[ValveRig::kPrestage], 5 * noise_of("prestage_pressure"));
}

// Where the load stood in the play nobody knows at a start; a torque beyond its noise does.
TEST(ControlValve, ATorqueSaysThatThePlayIsUsedUp) {
  for (const double torque : {-20.0, -0.3}) {
    ValveRig v({"backlash@transmission.linkage:gap=5e-5"});
    v.state()[ValveRig::kPiston] = v.state()[ValveRig::kCylinder] = 0;
    v.state()[ValveRig::kTorque] = torque;
    v.rig->set_modes(v.state());
    v.integrator->step(0, ValveRig::kStep, v.channels.data());
    EXPECT_NEAR(v.shows("load_torque"), torque < -1 ? torque : 0, 0.01);
  }
}

TEST(ControlValve, AQuarterOfTheStepChangesLittle) {
  // Largest difference over runs in sensor noises; nuisance effects on.
  for (const char* profile : {"multisine", "steps", "valve_steps", "open_multisine"}) {
    SimulationSetup setup = valve_setup(profile, valve().nuisance);
    const Recording coarse = simulate(valve(), setup, 20);
    setup.substep = 0.125e-3;
    const Recording fine = simulate(valve(), setup, 20);
    for (std::size_t c = 0; c < coarse.columns(); ++c) {
      if (valve().channels[c].role != Role::output) continue;
      double worst = 0;
      for (std::size_t k = 0; k < coarse.rows(); ++k)
        worst = std::max(worst, std::abs(coarse.at(k, c) - fine.at(k, c)));
      EXPECT_LT(worst, 0.1 * valve().channels[c].noise_std) << profile << " " << valve().channels[c].name;
    }
  }
}

TEST(ControlValve, TheMeanOfTheInnerLoopDrivesTheModelAsWell) {
  // Without noise a recording is what its model makes of the means of ten voltages.
  for (const char* profile : {"multisine", "duty", "valve_steps"}) {
    const Recording r = simulate(valve(), valve_setup(profile), 20);
    DrivenModel model(valve(), {});
    std::vector<double> squares(r.columns());
    std::vector<double> start;
    for (const State& state : valve().states) start.push_back(r.at(0, static_cast<std::size_t>(state.channel)));
    model.run(r, 0, r.rows(), {0}, start.data(), [&](std::size_t row, const double* predicted) {
      for (std::size_t c = 0; c < r.columns(); ++c) squares[c] += std::pow(predicted[c] - r.at(row, c), 2);
    });
    for (std::size_t c = 0; c < r.columns(); ++c) {
      if (valve().channels[c].role == Role::output) {
        EXPECT_LT(std::sqrt(squares[c] / static_cast<double>(r.rows())), valve().channels[c].noise_std)
            << profile << " " << valve().channels[c].name;
      }
    }
  }
}

TEST(ControlValve, InternalFlowsFillTheirVolumes) {
  // (7) integrated: what flows in is stored as pressure and pushes the piston, V/1.4 p' + P A x' = m R T.
  Datasheet sheet = valve();
  for (Channel channel : valve().not_recorded) {
    channel.role = Role::output;
    channel.minimum = -1e12;
    channel.maximum = 1e12;
    sheet.channels.push_back(channel);
  }
  SimulationSetup setup = valve_setup("duty");
  const Recording r = simulate(sheet, setup, 30);
  const auto c = static_cast<std::size_t>(sheet.channel("cylinder_net_mass_flow"));
  const auto p = static_cast<std::size_t>(sheet.channel("prestage_net_mass_flow"));
  for (std::size_t k = 100; k < r.rows(); k += 7) {
    const double spool = r.at(k, valve_column("spool_position"));
    if (std::abs(spool - 0.5) < 0.02) continue;
    EXPECT_GT(r.at(k, c) * (spool - 0.5), 0) << k;  // the spool fills above the middle and empties below
  }
  const auto travel = [&](std::size_t k) {
    return 0.0388 + 0.0776 / std::sqrt(2.0) * std::sin(r.at(k, valve_column("valve_position")) * kPi / 2 - kPi / 4);
  };
  double passed = 0, stored = 0, both_ways = 0;
  for (std::size_t k = 500; k + 1 < r.rows(); ++k) {
    const double heat = 287 * r.at(k, valve_column("ambient_temperature"));
    const double gas =
        0.5 * (r.at(k, valve_column("cylinder_pressure")) + r.at(k + 1, valve_column("cylinder_pressure")));
    const double volume = 0.4e-3 + 0.0201 * 0.5 * (travel(k) + travel(k + 1));
    const double change = r.at(k + 1, valve_column("cylinder_pressure")) - r.at(k, valve_column("cylinder_pressure"));
    stored += volume / 1.4 * change + (gas + kAir) * 0.0201 * (travel(k + 1) - travel(k));
    passed += 0.01 * heat * 0.5 * (r.at(k, c) + r.at(k + 1, c));
    both_ways += 0.01 * heat * std::abs(r.at(k, c));
  }
  EXPECT_NEAR(passed, stored, 0.01 * both_ways);
  double prestage = 0;
  for (std::size_t k = 500; k < r.rows(); ++k) prestage = std::max(prestage, std::abs(r.at(k, p)));
  EXPECT_GT(prestage, 1e-6);  // kg/s
}

TEST(ControlValve, FlowControlHoldsTheFlow) {
  // A rig off its datasheet on the thesis's excitation: after a step the flow follows its set point.
  const Recording r = simulate(valve(), off_nominal_valve("paper", 11), 400);
  double squares = 0;
  int count = 0;
  double changed = 0;
  for (std::size_t k = 1; k < r.rows(); ++k) {
    const double wanted = r.at(k, valve_column("flow_setpoint"));
    if (std::abs(wanted - r.at(k - 1, valve_column("flow_setpoint"))) > 1e-3) changed = r.time[k];
    if (r.time[k] < changed + 10) continue;
    squares += std::pow(r.at(k, valve_column("flow")) - wanted, 2);
    ++count;
  }
  EXPECT_GT(count, 15000);
  EXPECT_LT(std::sqrt(squares / count), 2.5e-4);  // of 0.028 m^3/s; the demand's own noise is 1.4e-4
}

}  // namespace
}  // namespace faultline
