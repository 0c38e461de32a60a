// The pump-controlled cylinder: the numbers of its source, its equations against a second implementation, convergence,
// what each effect does, and what drives the pumps.
#include "rigs/pump_cylinder/plant.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "faultline/rig/driven_model.h"
#include "rigs/pump_cylinder/runs.h"

namespace faultline {
namespace {

using State = std::array<double, 4>;  // x, v, P_A, P_B

double parameter(const char* name) {
  return cylinder().nominal()[static_cast<std::size_t>(cylinder().parameter(name))];
}

// The equations as the datasheet prints them, from numbers of its source.
State rates(const State& s, double w1, double w2, double gravity = 9.81) {
  const double a_a = 1.9635e-3, a_b = 1.0014e-3, d = 15.6e-6 / (2 * M_PI), c_i = 1.097e-12, c_e = 1.2e-13;
  const auto beta = [](double p) { return (9.9993e7 + p) * (1 / 0.0733 - std::log(1 + p / 9.9993e7)); };
  const double q_2a = d * w2 - c_i * (s[2] - s[3]) - c_e * s[2];
  const double q_2b = d * w2 - c_i * (s[2] - s[3]) + c_e * s[3];
  const double q_1a = d * w1 - c_i * s[2] - c_e * s[2];
  return {s[1], (a_a * s[2] - a_b * s[3] - 2600 * s[1] - 330 * std::tanh(s[1] / 0.002) - 12.3 * gravity) / 12.3,
          beta(s[2]) / (1.4258e-4 + a_a * s[0]) * (q_1a + q_2a - a_a * s[1]),
          beta(s[3]) / (7.6821e-5 - a_b * s[0]) * (a_b * s[1] - q_2b)};
}

TEST(PumpCylinder, OffsetSpeedsAreThePapers) {
  // Without gravity, at rest with 12 MPa: the printed psi and lambda hold the level.
  const double w2 = -0.0279 * 12 * 2 * M_PI, w1 = -1.2195 * w2;
  const State rate = rates({0, 0, 4.0530e6, 7.9470e6}, w1, w2, 0);
  EXPECT_NEAR(rate[1], 0, 0.1);                       // m/s^2: 1 N
  EXPECT_NEAR(rate[2] * 1.4258e-4 / 1.4e9, 0, 4e-9);  // m^3/s, of 9e-6 that the leaks take
  EXPECT_NEAR(rate[3] * 7.6821e-5 / 1.4e9, 0, 4e-9);
  EXPECT_NEAR(parameter("offset_gain") * 12e6, w2, 1e-3 * std::abs(w2));
  EXPECT_NEAR(parameter("offset_ratio"), w1 / w2, 1e-9);
}

// With leaks at every place, changed oil, and lines on either side, both or neither.
TEST(PumpCylinder, JacobianIsThatOfTheEquations) {
  const std::vector<std::string> common = {"laminar_leakage@flow.pump2_a_b:coefficient=2e-13",
                                           "laminar_leakage@flow.pump2_a_tank:coefficient=1e-13",
                                           "laminar_leakage@flow.pump2_b_tank:coefficient=1e-13",
                                           "laminar_leakage@flow.pump1_a_tank:coefficient=1e-13",
                                           "laminar_leakage@flow.chamber_a_chamber_b:coefficient=1e-13",
                                           "entrained_air@compliance.chamber_a:fraction=0.01"};
  for (const std::vector<std::string>& lines :
       {std::vector<std::string>{},
        {"line_inertia@line.a:inertance=2e7"},
        {"line_inertia@line.b:inertance=1e7"},
        {"line_inertia@line.a:inertance=2e7", "line_inertia@line.b:inertance=1e7"}}) {
    std::vector<EffectSpec> specs;
    for (const auto* texts : {&common, &lines})
      for (const std::string& text : *texts) specs.push_back(parse_effect(text));
    const EffectSet effects(cylinder(), specs, 1e-3, 1);
    PumpCylinder rig(cylinder(), cylinder().nominal(), effects);
    std::vector<double> channels(cylinder().channels.size());
    channels[cylinder_column("pump1_speed")] = 20;
    channels[cylinder_column("pump2_speed")] = -35;
    const auto n = static_cast<std::size_t>(rig.states());
    std::vector<double> state = {0.01, 0.003, 3e6, 8e6, 3.1e6, 1e-4, 7.9e6, -2e-4}, sizes = {1e-2, 1e-2, 1e6, 1e6};
    if (lines.size() == 1 && lines.front().find("line.b") != std::string::npos) state[4] = 7.9e6;
    for (std::size_t i = 4; i < n; ++i) sizes.push_back(i % 2 == 0 ? 1e6 : 1e-4);
    std::vector<double> rate(n), time_rate(n), up(n), down(n), entries(n * n);
    rig.jacobian(0, state.data(), channels.data(), rate.data(), time_rate.data(), entries.data());
    for (std::size_t column = 0; column < n; ++column) {
      const double kept = state[column], step = 1e-4 * sizes[column];
      state[column] = kept + step;
      rig.derivative(0, state.data(), channels.data(), up.data());
      state[column] = kept - step;
      rig.derivative(0, state.data(), channels.data(), down.data());
      state[column] = kept;
      for (std::size_t row = 0; row < n; ++row) {
        const double expected = (up[row] - down[row]) / (2 * step);
        EXPECT_NEAR(entries[column * n + row], expected,
                    1e-3 * std::abs(expected) + 1e-7 * std::abs(rate[row]) / sizes[column])
            << n << " states: " << row << " by " << column;
      }
    }
  }
}

// Within the table of its logarithm and beyond, of the lowest pressure too.
TEST(PumpCylinder, BulkModulusIsItsFormula) {
  const double c1 = 9.9993e7, c2 = 0.0733;
  const BulkModulus oil(c1, c2);
  for (const double pressure : {-5e5, -9e4, 0.0, 1.0, 4e6, 1.2345e7, 3.4e7, 3.6e7, 2e8}) {
    const double p = std::max(pressure, -9e4), expected = (c1 + p) * (1 / c2 - std::log1p(p / c1));
    EXPECT_NEAR(oil.value(pressure), expected, 1e-13 * expected) << pressure;
  }
}

TEST(PumpCylinder, EquationsAreTheDatasheets) {
  const EffectSet none(cylinder(), {}, 1e-3, 1);
  PumpCylinder rig(cylinder(), cylinder().nominal(), none);
  std::vector<double> channels(cylinder().channels.size());
  for (const State& s : {State{0.01, 0.05, 3e6, 8e6}, State{-0.04, -0.1, 6e6, 2e6}, State{0.03, 1e-3, -5e4, 9e6}}) {
    channels[cylinder_column("pump1_speed")] = 20;
    channels[cylinder_column("pump2_speed")] = -35;
    const State expected = rates(s, 20, -35);
    State got{};
    rig.derivative(0, s.data(), channels.data(), got.data());
    for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(got[i], expected[i], 1e-6 * std::abs(expected[i]) + 1e-12) << i;
  }
}

TEST(PumpCylinder, RunsAsTheEquationsIntegratedInSmallSteps) {
  // Runge-Kutta steps of 20 us of the equations above, under the speeds that the run recorded.
  const Recording r = cylinder_clean("steps", 8);
  const auto at = [&](std::size_t k, const char* name) { return r.at(k, cylinder_column(name)); };
  State s = {at(0, "position"), 0, at(0, "chamber_a_pressure"), at(0, "chamber_b_pressure")};
  double off_x = 0, off_a = 0, off_b = 0;
  for (std::size_t k = 0; k + 1 < r.rows(); ++k) {
    const double w1 = at(k, "pump1_speed"), w2 = at(k, "pump2_speed"), h = 20e-6;
    for (int i = 0; i < 50; ++i) {
      const auto moved = [&](const State& by, double step) {
        State next = s;
        for (std::size_t j = 0; j < 4; ++j) next[j] += step * by[j];
        return next;
      };
      const State k1 = rates(s, w1, w2), k2 = rates(moved(k1, h / 2), w1, w2), k3 = rates(moved(k2, h / 2), w1, w2),
                  k4 = rates(moved(k3, h), w1, w2);
      for (std::size_t j = 0; j < 4; ++j) s[j] += h / 6 * (k1[j] + 2 * k2[j] + 2 * k3[j] + k4[j]);
    }
    off_x = std::max(off_x, std::abs(s[0] - at(k + 1, "position")));
    off_a = std::max(off_a, std::abs(s[2] - at(k + 1, "chamber_a_pressure")));
    off_b = std::max(off_b, std::abs(s[3] - at(k + 1, "chamber_b_pressure")));
  }
  EXPECT_LT(off_x, 2e-6);
  EXPECT_LT(off_a, 1e4);  // Pa: an eighth of the transmitter's noise
  EXPECT_LT(off_b, 1e4);
}

TEST(PumpCylinder, HalfTheSubstepChangesLittle) {
  for (const char* profile : {"steps", "chirp", "training", "cycle"}) {
    for (const char* effect : {"", "coulomb_friction@force.piston:force=700", "line_inertia@line.a:inertance=2e6",
                               "backlash@transmission.plate:gap=5e-4"}) {
      std::vector<std::string> effects;
      if (*effect) effects.push_back(effect);
      const Recording coarse = cylinder_clean(profile, 10, effects), fine = cylinder_clean(profile, 10, effects, 5e-5);
      EXPECT_LT(cylinder_rms(coarse, fine, "position"), 1e-5) << profile << " " << effect;
      EXPECT_LT(cylinder_rms(coarse, fine, "chamber_a_pressure"), 1.5e4) << profile << " " << effect;
      EXPECT_LT(cylinder_rms(coarse, fine, "chamber_b_pressure"), 3e4) << profile << " " << effect;
    }
  }
}

TEST(PumpCylinder, EveryProfileStaysInTheStroke) {
  for (const Profile& profile : cylinder().profiles)
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
      SimulationSetup setup = cylinder_off_nominal(profile.name, seed);
      const Recording r = simulate(cylinder(), setup, profile.duration);
      double reach = 0, fastest = 0, low = 1e7, high = 0;
      for (std::size_t k = 0; k < r.rows(); ++k) {
        reach = std::max(reach, std::abs(r.at(k, cylinder_column("position"))));
        fastest = std::max(fastest, std::abs(r.at(k, cylinder_column("pump2_speed_command"))));
        low = std::min(low, r.at(k, cylinder_column("chamber_a_pressure")));
        high = std::max(high, r.at(k, cylinder_column("chamber_b_pressure")));
      }
      EXPECT_LT(reach, 0.0499) << profile.name << " seed " << seed;
      EXPECT_LT(fastest, 100) << profile.name << " seed " << seed;
      EXPECT_GT(low, 0) << profile.name << " seed " << seed;
      EXPECT_LT(high, 1e7) << profile.name << " seed " << seed;
    }
}

TEST(PumpCylinder, TracksWithinAFractionOfAMillimetre) {
  for (const char* profile : {"steps", "triangle"}) {
    SimulationSetup setup = cylinder_setup(profile);
    const Recording noisy = simulate(cylinder(), setup, 50);
    setup.noise = false;
    const Recording r = simulate(cylinder(), setup, 50);
    double squares = 0, low = 1e9, high = 0;
    for (std::size_t k = 0; k < r.rows(); ++k) {
      squares += std::pow(r.at(k, cylinder_column("position")) - r.at(k, cylinder_column("position_reference")), 2);
      for (const char* p : {"chamber_a_pressure", "chamber_b_pressure"}) {
        low = std::min(low, r.at(k, cylinder_column(p)));
        high = std::max(high, r.at(k, cylinder_column(p)));
      }
    }
    EXPECT_LT(std::sqrt(squares / static_cast<double>(r.rows())), 0.4e-3) << profile;
    EXPECT_GT(low, 2.8e6) << profile;
    EXPECT_LT(high, 9.5e6) << profile;
    EXPECT_EQ(noisy.rows(), 50001u);
  }
}

TEST(PumpCylinder, SpeedsFollowTheirCommands) {
  const Recording r = cylinder_clean("steps", 3);
  for (std::size_t k = 0; k < r.rows(); ++k) {
    ASSERT_NEAR(r.at(k, cylinder_column("pump1_speed")), r.at(k, cylinder_column("pump1_speed_command")), 1e-12);
    ASSERT_NEAR(r.at(k, cylinder_column("pump2_speed")), r.at(k, cylinder_column("pump2_speed_command")), 1e-12);
  }
  // A lag: the mean over the period follows the command by the time constant; the sensor shows it with its offset.
  const Recording slow = cylinder_clean(
      "triangle", 3, {"lag@command.pump2_speed:time_constant=0.008", "offset@sensor.pump2_speed:value=0.5"});
  const double slope =
      (slow.at(301, cylinder_column("pump2_speed_command")) - slow.at(201, cylinder_column("pump2_speed_command"))) /
      0.1;
  EXPECT_GT(std::abs(cylinder_mean(slow, "pump2_speed_command", 0.2, 0.3)), 1);
  EXPECT_NEAR(cylinder_mean(slow, "pump2_speed", 0.2, 0.3) - cylinder_mean(slow, "pump2_speed_command", 0.2, 0.3),
              0.5 - slope * (0.008 - 0.5e-3), 0.15);
}

TEST(PumpCylinder, DrivenModelTakesMeasuredSpeedsAndPredictsThem) {
  // What sits in the drive shows in the predicted speed and nowhere else; a sensor's fault shows in both.
  const Recording r = cylinder_clean("triangle", 4);
  const auto run = [&](const std::vector<std::string>& effects) {
    DrivenModel model(cylinder(), cylinder_setup("", effects));
    Recording result = r;
    model.run(r, 0, r.rows(), {}, nullptr, [&](std::size_t k, const double* row) {
      std::copy_n(row, r.columns(), result.values.begin() + static_cast<std::ptrdiff_t>(k * r.columns()));
    });
    return result;
  };
  const Recording plain = run({}), drive = run({"scale@command.pump2_speed:factor=1.05"}),
                  sensor = run({"offset@sensor.pump2_speed:value=0.5"});
  const double speed = cylinder_rms(r, Recording(drive), "pump2_speed");
  EXPECT_LT(cylinder_rms(r, plain, "pump2_speed"), 1e-12);
  EXPECT_LT(cylinder_rms(r, plain, "chamber_b_pressure"), 2e4);
  EXPECT_GT(speed, 0.5);
  EXPECT_LT(cylinder_rms(plain, drive, "chamber_b_pressure"), 1e-6);
  EXPECT_NEAR(cylinder_rms(plain, sensor, "pump2_speed"), 0.5, 1e-9);
  EXPECT_GT(cylinder_rms(plain, sensor, "chamber_b_pressure"), 2e5);
}

TEST(PumpCylinder, DrivenModelIsSettledAtEveryStep) {
  // From a measured state, out of balance by the noise of its pressures. With backlash the rod, light and braked by a
  // friction that turns over within a step, must come to rest beside the plate whatever the step.
  SimulationSetup noisy = cylinder_setup("steps", {}, 7);
  const Recording r = simulate(cylinder(), noisy, 3);
  std::vector<double> start;
  for (const char* name : {"position", "", "chamber_a_pressure", "chamber_b_pressure"})
    start.push_back(*name ? r.at(0, cylinder_column(name)) : 0.0);
  const auto run = [&](const std::string& effect, double substep) {
    SimulationSetup setup = cylinder_setup("", {effect});
    setup.substep = substep;
    DrivenModel model(cylinder(), setup);
    Recording result = r;
    model.run(r, 0, r.rows(), {0}, start.data(), [&](std::size_t k, const double* row) {
      std::copy_n(row, r.columns(), result.values.begin() + static_cast<std::ptrdiff_t>(k * r.columns()));
    });
    return result;
  };
  struct Expected {
    const char* effect;
    double widths;  // of the noise
  };
  for (const Expected& e :
       {Expected{"backlash@transmission.plate:gap=2e-4", 0.02}, Expected{"backlash@transmission.plate:gap=2e-3", 0.05},
        Expected{"line_inertia@line.a:inertance=2e7", 0.05}, Expected{"line_inertia@line.b:inertance=1e8", 0.05}}) {
    const Recording fine = run(e.effect, 2e-5);
    for (const double substep : {0.0, 1e-3 / 6, 1e-3 / 7, 1e-3 / 9, 1e-4, 1e-3 / 11}) {
      const Recording coarse = run(e.effect, substep);
      for (const char* name : {"position", "chamber_a_pressure", "chamber_b_pressure"}) {
        const double noise = r.channels[cylinder_column(name)].noise_std;
        EXPECT_LT(cylinder_rms(coarse, fine, name), e.widths * noise) << e.effect << " " << substep << " " << name;
      }
    }
  }
}

// P_A and P_B at rest under the position loop, whose w_dyn is free: (5)-(9) with q_A = q_B = 0 and gamma P_A = P_B +
// m g/A_B, with conductances added at A and at B to tank and viscosity times `factor`.
std::pair<double, double> pressures_at_rest(double to_tank_a, double to_tank_b, double factor) {
  const double gamma = 1.9635 / 1.0014, weight = 12.3 * 9.81 / 1.0014e-3, d = 15.6e-6 / (2 * M_PI);
  const double c_i = 1.097e-12 / factor, c_e = 1.2e-13 / factor, w2 = -1.753009e-7 * 12e6, w1 = -1.2195 * w2;
  // P_B = gamma P_A - weight; from B: d w_dyn = c_i (P_A - P_B) - (c_e + b) P_B - d w2; put into A:
  //   gamma d w_dyn + d (w1 + w2) = c_i (2 P_A - P_B) + (2 c_e + a) P_A
  const double left = gamma * (c_i * (1 - gamma) - (c_e + to_tank_b) * gamma) - c_i * (2 - gamma) - 2 * c_e - to_tank_a;
  const double right = gamma * d * w2 - d * (w1 + w2) - gamma * weight * (c_i + c_e + to_tank_b) + c_i * weight;
  const double a = right / left;
  return {a, gamma * a - weight};
}

TEST(PumpCylinder, LeaksAndViscosityMoveTheLevelAsTheBalancesSay) {
  const struct {
    const char* effect;
    double to_tank_a, to_tank_b, factor;
  } cases[] = {{"", 0, 0, 1},
               {"laminar_leakage@flow.pump2_b_tank:coefficient=2e-13", 0, 2e-13, 1},
               {"laminar_leakage@flow.pump1_a_tank:coefficient=5e-13", 5e-13, 0, 1},
               {"laminar_leakage@flow.pump2_a_tank:coefficient=5e-13", 5e-13, 0, 1},
               {"viscosity_drift@source.oil:factor=0.75", 0, 0, 0.75}};
  for (const auto& c : cases) {
    std::vector<std::string> effects;
    if (*c.effect) effects.push_back(c.effect);
    const Recording r = cylinder_clean("standstill", 20, effects);
    const auto [a, b] = pressures_at_rest(c.to_tank_a, c.to_tank_b, c.factor);
    // Commands are rounded to 0.0614 rad/s, which is 0.05 MPa of P_A.
    EXPECT_NEAR(cylinder_mean(r, "chamber_a_pressure", 10, 20), a, 8e4) << c.effect;
    EXPECT_NEAR(cylinder_mean(r, "chamber_b_pressure", 10, 20), b, 1.6e5) << c.effect;
  }
}

TEST(PumpCylinder, ReliefValveAndTransmittersShowAtPressureB) {
  const Recording plain = cylinder_clean("standstill", 10);
  const auto moved = [&](const char* effect) {
    return cylinder_mean(cylinder_clean("standstill", 10, {effect}), "chamber_b_pressure", 5, 10) -
           cylinder_mean(plain, "chamber_b_pressure", 5, 10);
  };
  const double relief = moved("relief_opening@flow.pump2_b_tank:cracking_pressure=7e6,slope=1e-11");
  EXPECT_GT(relief, -1.1e6);  // it holds 7 MPa and what its slope takes
  EXPECT_LT(relief, -7e5);
  EXPECT_NEAR(moved("offset@sensor.chamber_b_pressure:value=3e5"), 3e5, 1e2);
  EXPECT_NEAR(moved("scale@sensor.chamber_b_pressure:factor=0.5"),
              -0.5 * cylinder_mean(plain, "chamber_b_pressure", 5, 10), 1e2);
}

// The pump stands where its speed has brought it since the recording began, wherever a model is started.
TEST(PumpCylinder, TheShaftsAngleIsThatOfTheRecording) {
  SimulationSetup setup = cylinder_setup("training", {"displacement_ripple@source.pump2:amplitude=0.1,order=9"});
  setup.noise = false;
  const Recording recording = simulate(cylinder(), setup, 2);
  DrivenModel whole(cylinder(), setup), late(cylinder(), setup);
  std::vector<double> angle(2001), from_there(2001);
  const auto follow = [&](DrivenModel& model, std::size_t first, std::vector<double>& to) {
    model.run(recording, first, 2000 - first, {}, nullptr,
              [&](std::size_t k, const double*) { to[k] = model.state()[4]; });
  };
  follow(whole, 0, angle);
  follow(late, 1200, from_there);
  EXPECT_GT(std::abs(angle[1200]), 1);
  for (std::size_t k = 1200; k < 2000; k += 100) EXPECT_NEAR(from_there[k], angle[k], 1e-9 + 1e-6 * std::abs(angle[k]));
}

TEST(PumpCylinder, EveryEffectAtEveryPortShowsAndStaysFinite) {
  const Recording plain = cylinder_clean("training", 6);
  for (const Port& port : cylinder().ports)
    for (const FittingEffect& fitting : port.effects) {
      const EffectType& type = *find_effect_type(fitting.effect);
      EffectSpec spec;
      spec.effect = fitting.effect;
      spec.port = port.name;
      for (const EffectParameter& p : type.parameters) {
        const auto bound = fitting.bounds.find(p.name);
        spec.parameters.push_back(bound == fitting.bounds.end() ? not_given(p) : bound->second.maximum);
      }
      if (spec.effect == "stuck") spec.parameters[0] = 1;
      if (spec.effect == "rate_limit") spec.parameters[0] = 700;
      if (spec.effect == "relief_opening" || spec.effect == "end_stop")
        spec.parameters[0] = fitting.bounds.begin()->second.minimum;
      SimulationSetup setup = cylinder_setup("training");
      setup.noise = false;
      setup.effects.push_back(spec);
      const Recording r = simulate(cylinder(), setup, 6);
      double apart = 0;
      for (std::size_t k = 0; k < r.rows(); ++k)
        for (std::size_t c = 0; c < r.columns(); ++c) {
          ASSERT_TRUE(std::isfinite(r.at(k, c))) << to_string(spec);
          const Channel& channel = r.channels[c];
          if (channel.noise_std > 0) apart = std::max(apart, std::abs(r.at(k, c) - plain.at(k, c)) / channel.noise_std);
        }
      EXPECT_GT(apart, 0.5) << to_string(spec);
    }
}

TEST(PumpCylinder, BacklashLetsThePlateStayBehind) {
  // Friction of the plate against its weight: 165 N hold 114 N, so that it leaves the rod by the gap where that turns
  // down.
  const Recording plain = cylinder_clean("triangle", 6),
                  r = cylinder_clean("triangle", 6, {"backlash@transmission.plate:gap=1e-3"});
  double largest = 0;
  for (std::size_t k = 1000; k < r.rows(); ++k)
    largest =
        std::max(largest, std::abs(r.at(k, cylinder_column("position")) - plain.at(k, cylinder_column("position"))));
  EXPECT_GT(largest, 3e-4);
  EXPECT_LT(largest, 3e-3);
}

}  // namespace
}  // namespace faultline
