// Every effect at every port of the cooling circuit: it acts, stays finite over its whole range, starts at rest, and
// the Jacobian that the implicit steps use is that of the equations.
#include <gtest/gtest.h>

#include <algorithm>

#include "rigs/cooling_circuit/runs.h"

namespace faultline {
namespace {

class EveryCoolingEffect : public ::testing::TestWithParam<std::string> {};

TEST_P(EveryCoolingEffect, ActsOnTheOutputs) {
  if (GetParam().find("stuck") == 0 && GetParam().find("inlet_temperature") != std::string::npos)
    return;  // the water comes in at one temperature: only its noise would tell
  const double duration = 3;
  static const Recording plain = simulate(cooling(), cooling_setup("both_steps"), duration);
  const Recording r = simulate(cooling(), cooling_setup("both_steps", {GetParam()}), duration);
  double apart = 0;
  for (std::size_t k = 0; k < r.rows(); ++k)
    for (std::size_t c = 0; c < r.columns(); ++c) {
      ASSERT_TRUE(std::isfinite(r.at(k, c)));
      // The supply's own reading may be what the effect changes.
      if (r.channels[c].role == Role::command) continue;
      apart = std::max(apart, std::abs(r.at(k, c) - plain.at(k, c)) / r.channels[c].noise_std);
    }
  EXPECT_GT(apart, 1.0);
}

TEST_P(EveryCoolingEffect, JacobianIsThatOfTheRates) {
  // Against central differences, at rest and well away from it.
  CoolingRig bench(7e6, 0.8, 0.9, {GetParam()});
  const std::size_t n = bench.state.size();
  std::vector<double> rest = bench.state, rate(n), time_rate(n), low(n), high(n);
  std::vector<double> entries(bench.rig->jacobian_entries().size());
  for (const double away : {0.0, 0.02}) {
    std::vector<double> state = rest;
    for (std::size_t s = 0; s < n; ++s) state[s] *= 1 + away * (static_cast<double>((7 * s) % 5) - 2) / 5;
    bench.rig->jacobian(0.1, state.data(), bench.channels.data(), rate.data(), time_rate.data(), entries.data());
    std::vector<std::vector<double>> jacobian(n, std::vector<double>(n, 0.0));
    for (std::size_t e = 0; e < entries.size(); ++e) {
      const auto [row, column] = bench.rig->jacobian_entries()[e];
      jacobian[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)] += entries[e];
    }
    for (std::size_t column = 0; column < n; ++column) {
      const double step = 1e-6 * std::max(1.0, std::abs(state[column]));
      std::vector<double> moved = state;
      moved[column] = state[column] - step;
      bench.rig->derivative(0.1, moved.data(), bench.channels.data(), low.data());
      moved[column] = state[column] + step;
      bench.rig->derivative(0.1, moved.data(), bench.channels.data(), high.data());
      for (std::size_t row = 0; row < n; ++row) {
        const double difference = (high[row] - low[row]) / (2 * step);
        const double size = std::abs(jacobian[row][row]) * std::abs(state[row]) / std::abs(state[column]);
        EXPECT_NEAR(jacobian[row][column], difference, 2e-4 * std::abs(difference) + 2e-6 * size)
            << row << "," << column << (away > 0 ? " away" : " at rest");
      }
    }
    bench.rig->derivative(0.1 - 1e-5, state.data(), bench.channels.data(), low.data());
    bench.rig->derivative(0.1 + 1e-5, state.data(), bench.channels.data(), high.data());
    for (std::size_t row = 0; row < n; ++row) {
      const double difference = (high[row] - low[row]) / 2e-5;
      EXPECT_NEAR(time_rate[row], difference,
                  2e-3 * std::abs(difference) + 1e-6 * std::abs(jacobian[row][row] * state[row]))
          << row;
    }
  }
}

TEST_P(EveryCoolingEffect, StartsAtRest) {
  if (GetParam().find("@source.") != std::string::npos || GetParam().find("@sensor.") != std::string::npos)
    return;  // those that move with time, and those that the rig's equations do not see
  CoolingRig bench(7e6, 0.8, 0.9, {GetParam()});
  std::vector<double> rate(bench.state.size());
  bench.rig->derivative(0, bench.state.data(), bench.channels.data(), rate.data());
  for (std::size_t s = 0; s < rate.size(); ++s)
    EXPECT_NEAR(rate[s] * 1e-3, 0, 1e-6 * (1 + std::abs(bench.state[s]))) << s;
}

std::string name_of(const ::testing::TestParamInfo<std::string>& info) {
  std::string name = info.param.substr(0, info.param.find(':'));
  std::replace_if(
      name.begin(), name.end(), [](char c) { return !std::isalnum(static_cast<unsigned char>(c)); }, '_');
  return name;
}

// The branches are alike: one chamber branch and the nozzle stand for the others.
std::vector<std::string> some_effects() {
  std::vector<std::string> texts;
  for (const std::string& text : cooling_effects())
    if (text.find(".m_") == std::string::npos && text.find(".v1_") == std::string::npos &&
        text.find(".v3_") == std::string::npos)
      texts.push_back(text);
  return texts;
}

INSTANTIATE_TEST_SUITE_P(Effects, EveryCoolingEffect, ::testing::ValuesIn(some_effects()), name_of);

TEST(CoolingEffects, StayFiniteAtBothEndsOfTheirRanges) {
  for (const Port& port : cooling().ports)
    for (const FittingEffect& fitting : port.effects)
      for (const bool top : {false, true}) {
        EffectSpec spec;
        spec.effect = fitting.effect;
        spec.port = port.name;
        for (const EffectParameter& p : find_effect_type(fitting.effect)->parameters) {
          const auto bounds = fitting.bounds.find(p.name);
          spec.parameters.push_back(bounds == fitting.bounds.end()                 ? not_given(p)
                                    : top && std::isfinite(bounds->second.maximum) ? bounds->second.maximum
                                                                                   : bounds->second.minimum);
        }
        SimulationSetup setup = cooling_setup("both_steps");
        setup.effects = {spec};
        setup.substep = 1e-3;
        const Recording r = simulate(cooling(), setup, 1.5);
        for (const double value : r.values) ASSERT_TRUE(std::isfinite(value)) << to_string(spec);
      }
}

TEST(CoolingEffects, ActInEveryBranchOnThatBranch) {
  // A leak, a blockage and more heat in one branch move that branch's outlet more than any other's.
  const std::vector<std::string> branches = {"m", "v1", "v2", "v3", "t"};
  const CoolingRig sound(7e6, 0.9, 1);
  for (const std::string& here : branches)
    for (const std::string& effect :
         {"orifice_leakage@flow." + here + "_outlet_ambient:coefficient=1e-7",
          "orifice_leakage@flow." + here + "_inlet_ambient:coefficient=1e-7",
          "orifice_leakage@flow." + here + "_drain_ambient:coefficient=1e-7",
          "clogging@restriction." + here + "_feed:fraction=0.2", "clogging@restriction." + here + "_drain:fraction=0.2",
          "clogging@restriction." + here + "_orifice:fraction=0.4", "scale@heat." + here + "_wall:factor=1.3"}) {
      const CoolingRig faulty(7e6, 0.9, 1, {effect});
      std::string most;
      double largest = 0;
      for (const std::string& b : branches) {
        double moved = 0;
        for (const char* place : {"_inlet_pressure", "_outlet_pressure", "_outlet_temperature"}) {
          const std::string name = b + place;
          const double noise = cooling().channels[cooling_column(name)].noise_std;
          moved = std::max(moved, std::abs(faulty[name] - sound[name]) / noise);
        }
        if (moved > largest) most = b, largest = moved;
      }
      EXPECT_EQ(most, here) << effect;
      EXPECT_GT(largest, 10) << effect;
    }
}

TEST(CoolingEffects, SwellsComeAndGo) {
  const std::string leak = "orifice_leakage@flow.t_outlet_ambient:coefficient=1.28e-8,from=3,to=7,swells=2";
  SimulationSetup setup = cooling_setup("steady");
  const Recording plain = simulate(cooling(), setup, 9);
  setup.effects = {parse_effect(leak)};
  const Recording r = simulate(cooling(), setup, 9);
  const std::size_t p2 = cooling_column("t_outlet_pressure");
  const auto fall = [&](double time) {
    const auto k = static_cast<std::size_t>(std::lround(1000 * time));
    return plain.at(k, p2) - r.at(k, p2);
  };
  const double full = fall(4);
  EXPECT_GT(full, 1e4);
  EXPECT_EQ(fall(2.9), 0);
  EXPECT_NEAR(fall(3.5), 0.5 * full, 0.02 * full);
  EXPECT_NEAR(fall(5), 0, 0.01 * full);
  EXPECT_NEAR(fall(6), full, 0.01 * full);
  EXPECT_NEAR(fall(8), 0, 0.001 * full);
}

}  // namespace
}  // namespace faultline
