// The cooling circuit's physics: the datasheet's reference point and operating points, balances of mass and energy at
// rest and on the way, what each kind of leak does to the meter, how it starts and shuts.
#include "rigs/cooling_circuit/plant.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "faultline/rig/driven_model.h"
#include "faultline/signal/error.h"
#include "rigs/cooling_circuit/runs.h"

namespace faultline {
namespace {

const std::vector<std::string> kBranches = {"m", "v1", "v2", "v3", "t"};
constexpr double kDensity = 980, kHeat = 4180, kSound = 1450, kDrain = 1.013e5, kWater = 288;

double flux(const std::string& branch) {
  return cooling().nominal()[static_cast<std::size_t>(cooling().parameter(branch + "_heat_flux"))];
}

TEST(CoolingCircuit, RestsAtTheReferencePoint) {
  const CoolingRig rig(7.0e6, 1, 1);
  double total = 0;
  for (const std::string& b : kBranches) total += rig[b + "_mass_flow"];
  EXPECT_NEAR(total, 8.0, 0.08);
  EXPECT_NEAR(rig.state[2], 55e5, 0.5e5);
  for (const char* b : {"m", "v1", "v2", "v3"}) {
    const std::string name = b;
    EXPECT_NEAR(rig[name + "_mass_flow"], 1.5, 0.02);
    EXPECT_NEAR(rig[name + "_inlet_pressure"], 45e5, 0.5e5);
    EXPECT_NEAR(rig[name + "_outlet_pressure"], 43.9e5, 0.5e5);
  }
  EXPECT_NEAR(rig["t_mass_flow"], 2.0, 0.02);
  EXPECT_NEAR(rig["t_inlet_pressure"], 45e5, 0.5e5);
  EXPECT_NEAR(rig["t_outlet_pressure"], 34.6e5, 0.5e5);
  EXPECT_NEAR(rig["v2_outlet_temperature"], 312, 0.5);
  EXPECT_NEAR(rig["t_outlet_temperature"], 324, 0.5);
}

TEST(CoolingCircuit, RestIsRest) {
  for (const double valve : {0.0, 0.15, 0.7, 1.0})
    for (const double heat : {0.0, 0.2, 1.15}) {
      if (heat > 1.6 * valve) continue;
      CoolingRig rig(6.0e6, valve, heat);
      std::vector<double> rate(rig.state.size());
      rig.rig->derivative(0, rig.state.data(), rig.channels.data(), rate.data());
      for (std::size_t s = 0; s < rate.size(); ++s)  // per ms, against Pa and K
        EXPECT_NEAR(rate[s] * 1e-3, 0, 1e-6 * (1 + std::abs(rig.state[s]))) << s << " at " << valve << ", " << heat;
    }
}

TEST(CoolingCircuit, ShutItIsAtDrainPressureAndColdEvenWithHeatLoss) {
  const CoolingRig rig(7.0e6, 0, 0, {"heat_loss@heat.t_wall:coefficient=100"});
  for (const std::string& b : kBranches) {
    EXPECT_NEAR(rig[b + "_inlet_pressure"], kDrain, 1e-3);
    EXPECT_NEAR(rig[b + "_outlet_pressure"], kDrain, 1e-3);
    EXPECT_NEAR(rig[b + "_mass_flow"], 0, 1e-9);
    EXPECT_NEAR(rig[b + "_outlet_temperature"], kWater, 1e-9);
  }
}

// Water that is heated and stands has no temperature of rest: it starts as it came, whatever its viscosity depends on.
TEST(CoolingCircuit, HeatedWaterThatStandsStartsCold) {
  for (const char* effect : {"", "viscosity_drift@source.water:factor=0.5"})
    for (const auto& [supply, valve] : {std::pair{7e6, 0.0}, {0.5e5, 1.0}, {0.0, 0.3}}) {
      const CoolingRig rig(supply, valve, 1, *effect ? std::vector<std::string>{effect} : std::vector<std::string>());
      for (const double value : rig.state) ASSERT_TRUE(std::isfinite(value)) << effect;
      EXPECT_EQ(rig.state[1], 1);
      for (const std::string& b : kBranches) {
        EXPECT_NEAR(rig[b + "_outlet_temperature"], kWater, 1e-9);
        EXPECT_LT(rig[b + "_outlet_pressure"], kDrain + 1);
        EXPECT_LT(rig[b + "_mass_flow"], 0.01);
      }
    }
}

TEST(CoolingCircuit, WithoutAStateOfRestItSaysSo) {
  CoolingRig rig(7.0e6, 1, 1);
  rig.channels[cooling_column("supply_pressure")] = std::nan("");
  try {
    rig.rig->start(rig.channels.data(), rig.state.data());
    FAIL() << "a state of rest at a supply pressure that is not a number";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("does not settle at a supply of nan Pa"), std::string::npos)
        << error.what();
  }
}

TEST(CoolingCircuit, PrintedModelHoldsAtRest) {
  // (9): q = c q^0.125 sqrt(P_1 - P_2), with the identified c, at any operating point.
  for (const double supply : {50e5, 60e5, 70e5, 80e5})
    for (const double valve : {0.2, 0.7, 1.0}) {
      const CoolingRig rig(supply, valve, 0.1);
      for (const std::string& b : kBranches) {
        const double q = rig[b + "_mass_flow"];
        const double drop = rig[b + "_inlet_pressure"] - rig[b + "_outlet_pressure"];
        EXPECT_NEAR(q / (std::pow(q, 0.125) * std::sqrt(drop)), b == "t" ? 0.0018 : 0.0042, 1e-7) << b;
      }
    }
}

TEST(CoolingCircuit, HeatLeavesWithTheWaterAtRest) {
  for (const double heat : {0.3, 1.0}) {
    const CoolingRig rig(7.0e6, 0.9, heat, {"heat_loss@heat.v1_wall:coefficient=500", "scale@heat.v3_wall:factor=1.4"});
    for (const std::string& b : kBranches) {
      double in = heat * flux(b) * (b == "v3" ? 1.4 : 1.0);
      if (b == "v1") in -= 500 * (rig["v1_outlet_temperature"] - 293);
      const double out = kHeat * rig[b + "_mass_flow"] * (rig[b + "_outlet_temperature"] - kWater);
      EXPECT_NEAR(out, in, 1e-5 * in) << b;
    }
  }
}

TEST(CoolingCircuit, WaterIsConservedThroughSteps) {
  // What flows through the valve is what leaves by the throttles and what the volumes take up.
  const SimulationSetup setup = cooling_setup("both_steps");
  const Recording r = simulate(cooling(), setup, 20);
  double through = 0, moved = 0, stored = 0;
  const std::size_t last = r.rows() - 1;
  for (const std::string& b : kBranches) {
    const double compliance = b == "t" ? 5.0e-11 : 4.4e-11;
    for (const char* place : {"_inlet_pressure", "_outlet_pressure"})
      stored += compliance * (r.at(last, cooling_column(b + place)) - r.at(0, cooling_column(b + place)));
    for (std::size_t k = 1; k < r.rows(); ++k) {
      const std::size_t c = cooling_column(b + "_mass_flow");
      through -= 0.5e-3 * (r.at(k, c) + r.at(k - 1, c));
    }
  }
  const auto manifold = [&](std::size_t k) {  // from the flow in the trim orifice, which the tube's takes up at once
    const double q = r.at(k, cooling_column("v2_mass_flow")), p1 = r.at(k, cooling_column("v2_inlet_pressure"));
    return p1 + q * q / (1.5e-3 * 1.5e-3);
  };
  stored += 0.020 / (kSound * kSound) * (manifold(last) - manifold(0));
  double z = r.at(0, cooling_column("bench_valve_command"));
  for (std::size_t k = 1; k < r.rows(); ++k) {
    const double u = r.at(k - 1, cooling_column("bench_valve_command")), before = z;
    z = u + (z - u) * std::exp(-1e-3 / 0.15);
    const double drop = 0.5 * (r.at(k, cooling_column("supply_pressure")) - manifold(k) +
                               r.at(k - 1, cooling_column("supply_pressure")) - manifold(k - 1));
    moved += 1e-3 * 6.5e-3 * 0.5 * (z + before) * std::sqrt(drop);
  }
  EXPECT_GT(moved, 100);  // kg
  EXPECT_NEAR(through + moved, stored, 2e-4 * moved);
}

TEST(CoolingCircuit, HeatIsConservedThroughSteps) {
  // Heat in less heat carried off is what the two cavities' water holds.
  const Recording r = simulate(cooling(), cooling_setup("heat_steps"), 20);
  for (const std::string& b : kBranches) {
    const double mass = kDensity * kSound * kSound * (b == "t" ? 5.0e-11 : 4.4e-11);
    const std::size_t q = cooling_column(b + "_mass_flow"), t1 = cooling_column(b + "_inlet_temperature"),
                      t2 = cooling_column(b + "_outlet_temperature"), h = cooling_column("heat_load_command");
    double in = 0, out = 0, s = r.at(0, h);
    for (std::size_t k = 1; k < r.rows(); ++k) {
      const double u = r.at(k - 1, h), before = s;
      s = u + (s - u) * std::exp(-1e-3 / 0.15);
      in += 1e-3 * flux(b) * 0.5 * (s + before);
      out += 0.5e-3 * kHeat * (r.at(k, q) * (r.at(k, t2) - kWater) + r.at(k - 1, q) * (r.at(k - 1, t2) - kWater));
    }
    const std::size_t last = r.rows() - 1;
    const double held = mass * kHeat * (r.at(last, t2) - r.at(0, t2) + r.at(last, t1) - r.at(0, t1));
    EXPECT_NEAR(in - out, held, 1e-3 * in) << b;
  }
}

TEST(CoolingCircuit, LeaksBeforeAndAfterTheMeter) {
  const CoolingRig sound(7.0e6, 0.9, 1);
  const auto c_of = [](const CoolingRig& rig) {
    const double q = rig["t_mass_flow"];
    return q / (std::pow(q, 0.125) * std::sqrt(rig["t_inlet_pressure"] - rig["t_outlet_pressure"]));
  };
  // The paper's leak: 0.022 kg/s, 1.15 % of the nozzle's flow, c falls by about 1 % and P_2 falls.
  const CoolingRig paper(7.0e6, 0.9, 1, {"orifice_leakage@flow.t_outlet_ambient:coefficient=1.28e-8"});
  const double leak = kDensity * 1.28e-8 * std::sqrt(paper["t_outlet_pressure"] - kDrain);
  EXPECT_NEAR(leak, 0.022, 0.001);
  EXPECT_NEAR(leak / paper["t_mass_flow"], 0.0115, 0.001);
  EXPECT_NEAR(c_of(paper) / c_of(sound) - 1, -0.01, 0.002);
  EXPECT_LT(paper["t_outlet_pressure"], sound["t_outlet_pressure"] - 1e3);
  // After the meter: the meter reads throttle and leak, c is blind to it.
  const CoolingRig after(7.0e6, 0.9, 1, {"orifice_leakage@flow.t_drain_ambient:coefficient=1e-7"});
  const double drop = after["t_outlet_pressure"] - kDrain;
  EXPECT_NEAR(after["t_mass_flow"], (1.09e-3 + kDensity * 1e-7) * std::sqrt(drop), 1e-4);
  EXPECT_NEAR(c_of(after) / c_of(sound), 1, 1e-6);
  // Before the tube: c is blind too, the branch draws more and its pressures fall.
  const CoolingRig before(7.0e6, 0.9, 1, {"orifice_leakage@flow.t_inlet_ambient:coefficient=1e-7"});
  EXPECT_NEAR(c_of(before) / c_of(sound), 1, 1e-6);
  EXPECT_LT(before["t_inlet_pressure"], sound["t_inlet_pressure"] - 1e4);
  EXPECT_LT(before["t_mass_flow"], sound["t_mass_flow"]);
}

TEST(CoolingCircuit, TubeEffectsActAsTheDatasheetSays) {
  const auto law = [](const CoolingRig& rig, const char* b) {
    const std::string name = b;
    return std::pair{rig[name + "_mass_flow"], rig[name + "_inlet_pressure"] - rig[name + "_outlet_pressure"]};
  };
  const auto tube = [](double c, double drop) { return std::pow(c, 8.0 / 7) * std::pow(drop, 4.0 / 7); };
  const auto [clogged, clogged_drop] =
      law(CoolingRig(7e6, 0.9, 1, {"clogging@restriction.v2_orifice:fraction=0.3"}), "v2");
  EXPECT_NEAR(clogged, tube(0.0042 * 0.7, clogged_drop), 1e-6);
  const auto [rough, rough_drop] =
      law(CoolingRig(7e6, 0.4, 1, {"area_curve@restriction.t_orifice:exponent=0.875"}), "t");
  EXPECT_NEAR(rough, 2.0 * std::pow(tube(0.0018, rough_drop) / 2.0, 0.875), 1e-6);
  const auto [both, both_drop] = law(
      CoolingRig(7e6, 0.4, 1,
                 {"area_curve@restriction.v1_orifice:exponent=1.2", "clogging@restriction.v1_orifice:fraction=0.1"}),
      "v1");
  EXPECT_NEAR(both, 1.5 * std::pow(tube(0.0042, both_drop) / 1.5, 1.2) * std::pow(0.9, 8.0 / 7), 1e-6);
}

TEST(CoolingCircuit, ViscosityFallsWithTemperature) {
  // factor where (T_1 + T_2)/2 is 15 K above 288 K, exponential in between; c goes with mu^-0.125.
  const CoolingRig rig(7e6, 0.9, 1, {"viscosity_drift@source.water:factor=0.7"});
  for (const std::string& b : kBranches) {
    const double mean = 0.5 * (rig[b + "_inlet_temperature"] + rig[b + "_outlet_temperature"]);
    const double q = rig[b + "_mass_flow"];
    const double c = q / (std::pow(q, 0.125) * std::sqrt(rig[b + "_inlet_pressure"] - rig[b + "_outlet_pressure"]));
    EXPECT_NEAR(c / (b == "t" ? 0.0018 : 0.0042), std::pow(std::pow(0.7, (mean - 288) / 15), -0.125), 1e-5) << b;
  }
}

TEST(CoolingCircuit, SupplyDroopsWithTheFlow) {
  const CoolingRig sound(7e6, 0.9, 1), drooped(7e6, 0.9, 1, {"droop@source.supply:resistance=6e7"});
  double total = 0;
  for (const std::string& b : kBranches) total += drooped[b + "_mass_flow"];
  const double manifold = drooped.state[2];
  const double at_valve = manifold + std::pow(total / (6.5e-3 * 0.9), 2);
  EXPECT_NEAR(7e6 - at_valve, 6e7 * total / kDensity, 20);
  EXPECT_NEAR(7e6 - at_valve, 5e5, 0.5e5);  // the datasheet's 5 bar
  EXPECT_LT(manifold, sound.state[2] - 2e5);
}

TEST(CoolingCircuit, PaperSequenceRunsThroughItsPhases) {
  const Recording r = simulate(cooling(), cooling_setup("paper"), 60);
  const auto at = [&](double time, const char* channel) {
    return r.at(static_cast<std::size_t>(std::lround(1000 * time)), cooling_column(channel));
  };
  EXPECT_NEAR(at(1.9, "v2_mass_flow"), 0, 1e-9);
  EXPECT_NEAR(at(9.9, "v2_mass_flow"), 1.46, 0.02);
  EXPECT_NEAR(at(9.9, "v2_outlet_temperature"), kWater, 1e-6);
  EXPECT_NEAR(at(40, "v2_outlet_temperature"), kWater + 1.5e5 / (kHeat * at(40, "v2_mass_flow")), 0.05);
  EXPECT_NEAR(at(56.9, "v2_outlet_temperature"), kWater, 0.01);
  EXPECT_LT(at(60, "v2_mass_flow"), 0.02);
  EXPECT_GT(at(60, "v2_mass_flow"), 0);
}

TEST(CoolingCircuit, OperatingPointsDiffer) {
  // A 70 bar, u 0.9, h 1 | B 60 0.9 0.8 | C 70 0.7 1.1 | D 50 0.7 0.6 | E 80 1 1.15
  const struct {
    const char* profile;
    double supply, valve, heat;
  } points[] = {{"paper", 70e5, 0.9, 1},
                {"point_b", 60e5, 0.9, 0.8},
                {"point_c", 70e5, 0.7, 1.1},
                {"point_d", 50e5, 0.7, 0.6},
                {"point_e", 80e5, 1, 1.15}};
  for (const auto& point : points) {
    const Recording r = simulate(cooling(), cooling_setup(point.profile), 15);
    const CoolingRig rest(r.at(14900, cooling_column("supply_pressure")), point.valve, point.heat);
    EXPECT_NEAR(r.at(14900, cooling_column("supply_pressure")), point.supply, 2e4) << point.profile;
    for (const std::string& b : kBranches) {
      EXPECT_NEAR(r.at(14900, cooling_column(b + "_mass_flow")), rest[b + "_mass_flow"], 2e-3) << point.profile;
      EXPECT_NEAR(r.at(14900, cooling_column(b + "_outlet_temperature")), rest[b + "_outlet_temperature"], 0.05)
          << point.profile;
    }
  }
}

TEST(CoolingCircuit, HalfTheSubstepChangesLittle) {
  // Far below the sensors' noise, also from the coarser substep of the model that recordings drive.
  for (const char* profile : {"paper", "both_steps"})
    for (const char* effect :
         {"", "line_inertia@line.feed:inertance=1e7", "line_inertia@line.t_orifice:inertance=2.5e6",
          "entrained_air@compliance.manifold:fraction=0.1", "viscosity_drift@source.water:factor=0.6"}) {
      SimulationSetup setup =
          cooling_setup(profile, *effect ? std::vector<std::string>{effect} : std::vector<std::string>{});
      setup.substep = 0.125e-3;
      const Recording fine = simulate(cooling(), setup, 4);
      for (const double substep : {0.25e-3, 1e-3}) {
        setup.substep = substep;
        const Recording coarse = simulate(cooling(), setup, 4);
        double worst = 0;
        for (std::size_t k = 0; k < fine.rows(); ++k)
          for (std::size_t c = 0; c < fine.columns(); ++c)
            if (fine.channels[c].role == Role::output)
              worst = std::max(worst, std::abs(fine.at(k, c) - coarse.at(k, c)) / fine.channels[c].noise_std);
        EXPECT_LT(worst, substep < 0.5e-3 ? 5e-4 : 5e-3) << profile << " " << effect;
      }
    }
}

// Water that stands is as warm as the thermocouples show it, whatever is wrong with these, and not as it once came.
TEST(CoolingCircuit, WaterThatStandsStartsAsWarmAsARecordingShowsIt) {
  Recording r = simulate(cooling(), cooling_setup("paper"), 0.2);
  const std::size_t outlet = cooling_column("v1_outlet_temperature"), other = cooling_column("v2_outlet_temperature");
  for (std::size_t k = 0; k < r.rows(); ++k) r.values[k * r.columns() + outlet] = 297;
  for (const char* effect : {"", "offset@sensor.v1_outlet_temperature:value=3"}) {
    SimulationSetup setup = cooling_setup("paper");
    if (*effect) setup.effects.push_back(parse_effect(effect));
    DrivenModel model(cooling(), setup);
    model.run(r, 0, r.rows(), {}, nullptr, [&](std::size_t k, const double* shown) {
      EXPECT_NEAR(shown[outlet], 297, 1e-6) << k << " " << effect;
      EXPECT_NEAR(shown[other], r.at(0, other), 1e-6) << k;
    });
  }
  // Once it flows the start is forgotten.
  SimulationSetup setup = cooling_setup("paper");
  Recording flowing = simulate(cooling(), setup, 8);
  const std::vector<double> plain = flowing.values;
  flowing.values[outlet] = 297;
  DrivenModel model(cooling(), setup);
  model.run(flowing, 0, flowing.rows(), {}, nullptr, [&](std::size_t k, const double* shown) {
    if (k + 1000 > flowing.rows()) {
      EXPECT_NEAR(shown[outlet], plain[k * flowing.columns() + outlet], 0.01) << k;
    }
  });
}

// Heat that flows though nothing moves: the water's temperature never settles. Models that are tried may be such, and
// begin from what is measured.
TEST(CoolingCircuit, AModelWithoutAStateOfRestBeginsFromMeasuredStates) {
  const Recording r = simulate(cooling(), cooling_setup("paper"), 0.2);
  ASSERT_EQ(r.at(0, cooling_column("bench_valve_command")), 0);
  SimulationSetup setup;
  setup.effects.push_back(parse_effect("free_signal@heat.m_wall:value=0.01"));
  DrivenModel model(cooling(), setup);
  const auto nothing = [](std::size_t, const double*) {};
  EXPECT_THROW(model.run(r, 0, 2, {0}, nullptr, nothing), InputError);
  std::vector<double> start;
  for (const State& state : cooling().states)
    start.push_back(state.channel < 0 ? std::nan("") : r.at(0, static_cast<std::size_t>(state.channel)));
  std::vector<double> predicted(r.columns());
  model.run(r, 0, 1, {0}, start.data(),
            [&](std::size_t, const double* values) { std::copy_n(values, predicted.size(), predicted.begin()); });
  EXPECT_NEAR(predicted[cooling_column("m_inlet_pressure")], r.at(0, cooling_column("m_inlet_pressure")), 1);
}

}  // namespace
}  // namespace faultline
