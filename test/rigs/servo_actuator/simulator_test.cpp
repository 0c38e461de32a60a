// The simulator with the servo actuator: determinism, convergence, what sensors do, the physics of the nominal model,
// and the numbers that the datasheet's source gives for this rig.
#include "faultline/rig/simulator.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "faultline/rig/driven_model.h"
#include "faultline/rig/rig.h"
#include "faultline/signal/error.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

double largest_difference(const Recording& a, const Recording& b, const std::string& channel) {
  double largest = 0;
  for (std::size_t k = 0; k < a.rows(); ++k)
    largest = std::max(largest, std::abs(a.at(k, column(channel)) - b.at(k, column(channel))));
  return largest;
}

bool same_bytes(const Recording& a, const Recording& b) {
  return a.values.size() == b.values.size() && a.time == b.time && a.sequence == b.sequence &&
         std::memcmp(a.values.data(), b.values.data(), a.values.size() * sizeof(double)) == 0;
}

TEST(Simulator, SameSeedSameBytesOtherSeedOtherNoise) {
  SimulationSetup setup = off_nominal("random", 3);
  setup.effects.push_back(parse_effect("lag@sensor.velocity:time_constant=0.002"));
  const Recording a = simulate(servo(), setup, 4), b = simulate(servo(), setup, 4);
  EXPECT_TRUE(same_bytes(a, b));
  setup.seed = 4;
  const Recording c = simulate(servo(), setup, 4);
  std::size_t different = 0;
  for (std::size_t k = 0; k < a.rows(); ++k) different += a.at(k, column("velocity")) != c.at(k, column("velocity"));
  EXPECT_GT(different, a.rows() * 9 / 10);
}

TEST(Simulator, RowsAreNumberedAndTimed) {
  const Recording r = simulate(servo(), servo_setup("square"), 0.5);
  ASSERT_EQ(r.rows(), 501u);
  for (std::size_t k = 0; k < r.rows(); ++k) {
    EXPECT_EQ(r.sequence[k], k);
    EXPECT_NEAR(r.time[k], static_cast<double>(k) * 1e-3, 1e-12);
  }
}

TEST(Simulator, ResetGivesTheSameRowsAgain) {
  SimulationSetup setup = off_nominal("steps", 5);
  setup.effects.push_back(parse_effect("delay@command.valve_command:time=0.004"));
  setup.effects.push_back(parse_effect("orifice_leakage@flow.chamber_a_chamber_b:coefficient=1e-8,from=0.2,to=0.6"));
  Simulator simulator(servo(), setup);
  std::vector<std::vector<double>> first;
  for (int k = 0; k < 1500; ++k) first.push_back(simulator.step().values);
  simulator.reset();
  for (int k = 0; k < 1500; ++k) {
    const Sample& sample = simulator.step();
    ASSERT_EQ(sample.sequence, static_cast<std::uint64_t>(k));
    ASSERT_EQ(std::memcmp(sample.values.data(), first[static_cast<std::size_t>(k)].data(),
                          sample.values.size() * sizeof(double)),
              0)
        << "row " << k;
  }
}

TEST(Simulator, HalfTheSubstepChangesLittle) {
  // The error is that of stick and slip, which end on whole substeps.
  for (const char* profile : {"square", "random", "cycle", "prbs"}) {
    SimulationSetup setup = servo_setup(profile);
    setup.noise = false;
    const Recording coarse = simulate(servo(), setup, 10);
    setup.substep = 0.125e-3;
    const Recording fine = simulate(servo(), setup, 10);
    EXPECT_LT(largest_difference(coarse, fine, "position"), 4e-5) << profile;
    double squares = 0;
    for (std::size_t k = 0; k < coarse.rows(); ++k)
      squares += std::pow(coarse.at(k, column("load_pressure")) - fine.at(k, column("load_pressure")), 2);
    EXPECT_LT(std::sqrt(squares / static_cast<double>(coarse.rows())), 1.0e4) << profile;  // the transducer's noise
  }
}

TEST(Simulator, NoiseAndResolutionAreTheDatasheets) {
  // Standstill: outputs hardly move, so what varies from one sample to the next is the sensors' noise.
  SimulationSetup setup = servo_setup("standstill");
  const Recording noisy = simulate(servo(), setup, 20);
  for (std::size_t c = 0; c < servo().channels.size(); ++c) {
    const Channel& channel = servo().channels[c];
    if (channel.role != Role::output && channel.role != Role::input) continue;
    double squares = 0, quantum = 0;
    for (std::size_t k = 1; k < noisy.rows(); ++k) {
      squares += std::pow(noisy.at(k, c) - noisy.at(k - 1, c), 2);
      if (channel.resolution > 0) {
        const double steps = noisy.at(k, c) / channel.resolution;
        quantum = std::max(quantum, std::abs(steps - std::round(steps)));
      }
    }
    EXPECT_LT(quantum, 1e-6) << channel.name;
    const double std = std::sqrt(squares / (2.0 * static_cast<double>(noisy.rows() - 1)));
    if (channel.name == "leak_flow") {  // cut at zero: half of a normal distribution, E(d^2)/2 = s^2 (1/2 - 1/(2 pi))
      EXPECT_NEAR(std, channel.noise_std * std::sqrt(0.5 - 1 / (2 * 3.14159265358979)), 0.03 * channel.noise_std);
      continue;
    }
    const double expected =
        std::sqrt(channel.noise_std * channel.noise_std + channel.resolution * channel.resolution / 12);
    EXPECT_NEAR(std, expected, 0.03 * expected) << channel.name;
  }
}

TEST(Simulator, WithoutNoiseThereIsNone) {
  SimulationSetup setup = servo_setup("standstill");
  setup.noise = false;
  const Recording r = simulate(servo(), setup, 2);
  for (std::size_t k = 500; k < r.rows(); ++k) ASSERT_EQ(r.at(k, column("leak_flow")), 0.0);
}

TEST(Simulator, ChambersAddUpToTheSupplyAndTheValveBalances) {
  // Paper, (2) and (4): with p_a + p_b = P_s both edges of the valve pass the same flow, which at steady speed is A v.
  SimulationSetup setup = servo_setup("triangle");
  setup.noise = false;
  const Recording r = simulate(servo(), setup, 20);
  double worst_sum = 0, worst_flow = 0;
  int steady = 0;
  const double area = 6.33e-4, flow_coefficient = 1.47e-8;
  for (std::size_t k = 1000; k < r.rows(); ++k) {
    const double p_a = r.at(k, column("chamber_a_pressure")), p_b = r.at(k, column("chamber_b_pressure"));
    const double supply = r.at(k, column("supply_pressure")), spool = r.at(k, column("spool_position"));
    worst_sum = std::max(worst_sum, std::abs(p_a + p_b - supply));
    const double change = std::abs(r.at(k, column("load_pressure")) - r.at(k - 50, column("load_pressure")));
    const double speed = r.at(k, column("velocity"));
    if (change > 2e3 || std::abs(speed) < 0.02) continue;
    ++steady;
    const double in = flow_coefficient * spool * std::sqrt(supply - (spool > 0 ? 1 : -1) * (p_a - p_b));
    worst_flow = std::max(worst_flow, std::abs(in - area * speed) / (area * std::abs(speed)));
  }
  EXPECT_LT(worst_sum, 0.03 * 6.89e6);  // the volumes differ away from mid-stroke, so the sum swings a little
  EXPECT_GT(steady, 1000);
  EXPECT_LT(worst_flow, 0.02);
}

TEST(Simulator, VolumeIsConserved) {
  // beta_e/V dp/dt integrated: flow in minus flow displaced minus leak is stored as pressure, chamber by chamber, over
  // a run.
  SimulationSetup setup = servo_setup("random");
  setup.noise = false;
  open_bypass(setup, 1, 5);
  setup.effects.push_back(parse_effect("orifice_leakage@flow.chamber_a_tank:coefficient=1e-9"));
  const Recording r = simulate(servo(), setup, 12);
  const double volume = 4.56e-4, area = 6.33e-4, beta = volume / (2 * 1.14e-12), root_two = std::sqrt(2.0);
  double through_a = 0, stored_a = 0, moved = 0;
  for (std::size_t k = 1; k < r.rows(); ++k) {
    const auto mean = [&](const char* name) { return 0.5 * (r.at(k, column(name)) + r.at(k - 1, column(name))); };
    const double p_a = mean("chamber_a_pressure"), spool = mean("spool_position");
    const double drop = spool > 0 ? mean("supply_pressure") - p_a : p_a;
    const double valve = 1.47e-8 * spool * root_two * std::sqrt(drop);
    const double across = mean("load_pressure");
    const double leak = (r.time[k] > 1.02 ? 7.82e-9 * 5 : 0.0) * across / std::pow(across * across + 1e6, 0.25);
    through_a += 1e-3 * (valve - leak - 1e-9 * std::sqrt(p_a));
    moved += std::abs(1e-3 * valve);
    stored_a += (volume + area * mean("position")) / beta *
                (r.at(k, column("chamber_a_pressure")) - r.at(k - 1, column("chamber_a_pressure")));
  }
  const std::size_t last = r.rows() - 1;
  const double displaced = area * (r.at(last, column("position")) - r.at(0, column("position")));
  EXPECT_GT(moved, 1e-5);
  EXPECT_NEAR(through_a, stored_a + displaced, 0.01 * moved);
}

TEST(Simulator, PistonSticksBelowBreakaway) {
  // No command and a load of 430 N, below F_c + F_e = 450 N: standstill is exact. With 470 N it gives way.
  Datasheet sheet = servo();
  for (Profile& profile : sheet.profiles)
    if (profile.name == "prbs") {
      profile.shape = "constant";
      profile.settings = Settings("test", {{"value", 0.0}}, {}, {});
    }
  SimulationSetup setup = servo_setup("prbs");
  setup.noise = false;
  setup.effects.push_back(parse_effect("load_force@force.piston:constant=430,stiffness=0"));
  Recording r = simulate(sheet, setup, 10);
  double creep = 0;
  for (std::size_t k = 0; k < r.rows(); ++k) creep = std::max(creep, std::abs(r.at(k, column("position"))));
  EXPECT_LT(creep, 1e-9);
  setup.effects[0] = parse_effect("load_force@force.piston:constant=470,stiffness=0");
  r = simulate(sheet, setup, 10);
  EXPECT_LT(r.at(r.rows() - 1, column("position")), -1e-5);  // the force acts towards -x
}

TEST(Simulator, LeakAtFiveVoltsFlowsAsThePaperSays) {
  SimulationSetup setup = servo_setup("square");
  open_bypass(setup, 0, 5);
  const Recording r = simulate(servo(), setup, 60);
  const double flow = 1e3 * mean_of(r, "leak_flow", 20, 60);
  EXPECT_GT(flow, 0.030);
  EXPECT_LT(flow, 0.034);
}

TEST(Simulator, TracksTheRandomSetPointAsThePaperSays) {
  double worst = 0, squares = 0;
  int count = 0;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const Recording r = simulate(servo(), servo_setup("random", seed), 25);
    for (std::size_t k = 15000; k < r.rows(); ++k) {
      const double off = r.at(k, column("position")) - r.at(k, column("position_reference"));
      worst = std::max(worst, std::abs(off));
      squares += off * off;
      ++count;
      ASSERT_LT(std::abs(r.at(k, column("valve_command"))), 5.5);
    }
  }
  EXPECT_LT(worst, 2.2e-3);
  EXPECT_NEAR(std::sqrt(squares / count), 3.4e-4, 1.0e-4);
}

TEST(Simulator, EffectRampsFromItsStartToItsEnd) {
  SimulationSetup plain = servo_setup("square");
  plain.noise = false;
  SimulationSetup ramped = plain;
  ramped.effects.push_back(parse_effect("offset@sensor.chamber_b_pressure:value=2e5,from=2,to=4"));
  const Recording a = simulate(servo(), plain, 6), b = simulate(servo(), ramped, 6);
  const auto off = [&](std::size_t row) {
    return b.at(row, column("chamber_b_pressure")) - a.at(row, column("chamber_b_pressure"));
  };
  EXPECT_EQ(off(1500), 0);
  EXPECT_EQ(off(2000), 0);
  EXPECT_NEAR(off(2500), 0.25 * 2e5, 2e5 * 1e-3);
  EXPECT_NEAR(off(3000), 0.5 * 2e5, 2e5 * 1e-3);
  EXPECT_NEAR(off(4500), 2e5, 1e-3);
}

TEST(Simulator, StepEffectActsFromItsTime) {
  SimulationSetup setup = servo_setup("random");
  setup.noise = false;
  const Recording plain = simulate(servo(), setup, 4);
  setup.effects.push_back(parse_effect("scale@command.valve_command:factor=0.6,from=2"));
  const Recording r = simulate(servo(), setup, 4);
  const std::size_t spool = column("spool_position");
  for (std::size_t k = 0; k <= 2000; ++k) ASSERT_EQ(plain.at(k, spool), r.at(k, spool)) << k;
  double apart = 0;
  for (std::size_t k = 2001; k < r.rows(); ++k) apart = std::max(apart, std::abs(plain.at(k, spool) - r.at(k, spool)));
  EXPECT_GT(apart, 0.05);
}

TEST(Simulator, BadSetupsAreRefused) {
  SimulationSetup setup = servo_setup("square");
  setup.parameters = {1, 2, 3};
  EXPECT_THROW(Simulator(servo(), setup), InputError);
  setup = servo_setup("no_such_profile");
  EXPECT_THROW(Simulator(servo(), setup), InputError);
  setup = servo_setup("square");
  setup.commands.push_back({"velocity", {0}, {1}});
  EXPECT_THROW(Simulator(servo(), setup), InputError);
}

TEST(DrawParameters, StayWithinTwoTolerancesAndDependOnTheSeed) {
  const std::vector<double> nominal = servo().nominal(), drawn = draw_parameters(servo(), 7);
  EXPECT_EQ(drawn, draw_parameters(servo(), 7));
  EXPECT_NE(drawn, draw_parameters(servo(), 8));
  for (std::size_t i = 0; i < nominal.size(); ++i)
    EXPECT_LE(std::abs(drawn[i] - nominal[i]), 2.0001 * servo().parameters[i].tolerance * std::abs(nominal[i]));
}

class Driven : public ::testing::TestWithParam<const char*> {};

// Largest difference of the driven model from a recording without noise, in the channel's range.
double driven_apart(const char* profile, double substep) {
  SimulationSetup setup = servo_setup(profile);
  setup.noise = false;
  setup.effects.push_back(parse_effect("lag@sensor.velocity:time_constant=0.004"));
  setup.effects.push_back(parse_effect("deadband@command.valve_command:width=0.3"));
  const Recording r = simulate(servo(), setup, 8);
  setup.substep = substep;
  DrivenModel model(servo(), setup);
  double worst = 0;
  model.run(r, 0, r.rows(), {}, nullptr, [&](std::size_t k, const double* row) {
    for (std::size_t c = 0; c < r.columns(); ++c)
      if (r.channels[c].role == Role::output)
        worst = std::max(worst, std::abs(row[c] - r.at(k, c)) / (r.channels[c].maximum - r.channels[c].minimum));
  });
  return worst;
}

TEST_P(Driven, ReproducesARecordingWithoutNoise) {
  EXPECT_LT(driven_apart(GetParam(), find_rig_type("servo_actuator")->substep), 1e-12);
}

// The model's own step is twice as long: still within the transducers' noise, which is 1e-3 of range.
TEST_P(Driven, ReproducesARecordingWithinTheNoiseAtItsOwnStep) { EXPECT_LT(driven_apart(GetParam(), 0), 1e-3); }

INSTANTIATE_TEST_SUITE_P(Profiles, Driven, ::testing::Values("square", "random", "prbs", "cycle", "standstill"));

TEST(DrivenModel, RestartsPutTheStatesBack) {
  SimulationSetup setup = servo_setup("random");
  setup.noise = false;
  const Recording r = simulate(servo(), setup, 6);
  // Started from wrong states at row 1000, put right at row 2000 (spool and pressures as measured there).
  const auto state_at = [&](std::size_t row) {
    return std::vector<double>{r.at(row, column("position")),
                               r.at(row, column("velocity")),
                               r.at(row, column("chamber_a_pressure")),
                               r.at(row, column("chamber_b_pressure")),
                               r.at(row, column("spool_position")),
                               0,
                               0};
  };
  std::vector<double> states = state_at(1000);
  states[0] += 0.01;
  const std::vector<double> right = state_at(2000);
  states.insert(states.end(), right.begin(), right.end());
  DrivenModel model(servo(), setup);
  double before = 0, after = 0, at_restart = 0;
  std::size_t rows = 0;
  model.run(r, 1000, 2000, {1000, 2000}, states.data(), [&](std::size_t k, const double* row) {
    const double off = std::abs(row[column("position")] - r.at(k, column("position")));
    if (k < 2000) before = std::max(before, off);
    if (k == 2000) at_restart = off;  // still shows where the segment before it ended
    if (k > 2000) after = std::max(after, off);
    ++rows;
  });
  EXPECT_EQ(rows, 2000u);
  EXPECT_NEAR(before, 0.01, 1e-3);
  EXPECT_NEAR(at_restart, 0.01, 1e-3);
  EXPECT_LT(after, 1e-5);
}

// ---- Every effect of the sheet at every port

struct Place {
  std::string port, effect;
};

std::vector<Place> places() {
  std::vector<Place> all;
  for (const Port& port : servo().ports)
    for (const FittingEffect& fitting : port.effects) all.push_back({port.name, fitting.effect});
  return all;
}

EffectSpec sized(const Place& place, double share) {
  const EffectType& type = *find_effect_type(place.effect);
  EffectSpec spec;
  spec.effect = place.effect;
  spec.port = place.port;
  for (const FittingEffect& fitting : servo().port(place.port).effects) {
    if (fitting.effect != place.effect) continue;
    for (const EffectParameter& parameter : type.parameters) {
      if (place.effect == "stuck") {
        spec.parameters.push_back(0.5 + 2 * share);  // s; the bounds reach to infinity
        continue;
      }
      if (fitting.bounds.count(parameter.name) == 0) {  // a shape of which a datasheet need say nothing
        spec.parameters.push_back(not_given(parameter));
        continue;
      }
      const Bounds bounds = fitting.bounds.at(parameter.name);
      // Evenly in the logarithm where the bounds allow, else evenly.
      spec.parameters.push_back(bounds.minimum > 0 ? bounds.minimum * std::pow(bounds.maximum / bounds.minimum, share)
                                                   : bounds.minimum + share * (bounds.maximum - bounds.minimum));
    }
  }
  return spec;
}

class EveryEffect : public ::testing::TestWithParam<Place> {};

TEST_P(EveryEffect, StaysFiniteAndShows) {
  SimulationSetup setup = servo_setup("steps");
  setup.noise = false;
  const Recording plain = simulate(servo(), setup, 3);
  for (const double share : {0.02, 0.4, 0.98}) {
    setup.effects = {sized(GetParam(), share)};
    const Recording r = simulate(servo(), setup, 3);
    double signature = 0;
    for (std::size_t c = 0; c < r.columns(); ++c) {
      const Channel& channel = r.channels[c];
      for (std::size_t k = 0; k < r.rows(); ++k) {
        ASSERT_TRUE(std::isfinite(r.at(k, c))) << channel.name << " row " << k << " " << to_string(setup.effects[0]);
        if (channel.role != Role::output) continue;
        ASSERT_LT(std::abs(r.at(k, c)), 20 * channel.maximum)
            << channel.name << " row " << k << " " << to_string(setup.effects[0]);
        signature = std::max(signature, std::abs(r.at(k, c) - plain.at(k, c)) / (channel.maximum - channel.minimum));
      }
    }
    // A stop beyond the travel of this run, or a limit above its commands, shows nothing.
    if ((GetParam().effect == "end_stop" || GetParam().effect == "saturation") && share > 0.9) continue;
    EXPECT_GT(signature, 1e-6) << to_string(setup.effects[0]);
  }
}

TEST_P(EveryEffect, NoEffectValueChangesNothing) {
  const EffectType& type = *find_effect_type(GetParam().effect);
  SimulationSetup setup = servo_setup("multisine");
  const Recording plain = simulate(servo(), setup, 1.5);
  EffectSpec spec = sized(GetParam(), 0.5);
  for (std::size_t i = 0; i < type.parameters.size(); ++i)
    if (!std::isnan(type.parameters[i].none)) spec.parameters[i] = type.parameters[i].none;
  setup.effects = {spec};
  EXPECT_TRUE(same_bytes(simulate(servo(), setup, 1.5), plain)) << to_string(spec);
}

TEST_P(EveryEffect, GrowsDuringARun) {
  SimulationSetup setup = servo_setup("steps");
  setup.noise = false;
  const Recording plain = simulate(servo(), setup, 2);
  EffectSpec spec = sized(GetParam(), 0.9);
  spec.from = 0.5;
  spec.to = 1.5;
  spec.from_given = true;
  setup.effects = {spec};
  const Recording r = simulate(servo(), setup, 2);
  const bool more_states = GetParam().port == "line.valve_cylinder" || GetParam().port == "transmission.rod";
  for (std::size_t k = 0; k < r.rows(); ++k)
    for (std::size_t c = 0; c < r.columns(); ++c) {
      ASSERT_TRUE(std::isfinite(r.at(k, c))) << r.channels[c].name << " row " << k;
      const double span = r.channels[c].maximum - r.channels[c].minimum;
      if (k <= 500 && GetParam().effect != "stuck") {
        ASSERT_NEAR(r.at(k, c), plain.at(k, c), more_states ? 0.05 * span : 0.0) << r.channels[c].name << " row " << k;
      }
    }
}

// What effects add - a load on one flank of its play, a swinging oil column - goes on when the states are put back to
// where they are.
TEST_P(EveryEffect, PuttingStatesBackToWhereTheyAreChangesNothing) {
  if (servo().port(GetParam().port).kind == PortKind::sensor) return;  // shows the states otherwise than they are
  for (const double share : {0.3, 0.9}) {
    SimulationSetup setup = servo_setup("square");
    setup.noise = false;
    setup.effects = {sized(GetParam(), share)};
    const Recording r = simulate(servo(), setup, 2);
    setup.substep = find_rig_type("servo_actuator")->substep;
    std::vector<std::size_t> restarts;
    std::vector<double> states;
    for (std::size_t k = 0; k < r.rows(); k += 250) {
      restarts.push_back(k);
      for (const char* shown : {"position", "velocity", "chamber_a_pressure", "chamber_b_pressure", "spool_position"})
        states.push_back(r.at(k, column(shown)));
      states.insert(states.end(), 2, std::nan(""));
    }
    DrivenModel model(servo(), setup);
    model.run(r, 0, r.rows(), restarts, states.data(), [&](std::size_t k, const double* row) {
      for (std::size_t c = 0; c < r.columns(); ++c) {
        const Channel& channel = r.channels[c];
        if (channel.role != Role::output) continue;
        ASSERT_NEAR(row[c], r.at(k, c), 1e-4 * (channel.maximum - channel.minimum))
            << channel.name << " row " << k << " " << to_string(setup.effects[0]);
      }
    });
  }
}

std::string place_name(const ::testing::TestParamInfo<Place>& info) {
  std::string name = info.param.effect + "_at_" + info.param.port;
  std::replace(name.begin(), name.end(), '.', '_');
  return name;
}

INSTANTIATE_TEST_SUITE_P(Servo, EveryEffect, ::testing::ValuesIn(places()), place_name);

}  // namespace
}  // namespace faultline
