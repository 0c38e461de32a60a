// The fit on runs of the simulator whose parameters are known: estimates lie within their intervals, and what a run
// cannot tell is said.
#include "faultline/fit/parameter_fit.h"
#include "faultline/numerics/quantiles.h"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>

#include <Eigen/LU>

#include "faultline/numerics/in_parallel.h"
#include "faultline/signal/error.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

const FittedParameter& find(const ParameterFit& fit, const std::string& name) {
  for (const FittedParameter& p : fit.parameters)
    if (p.name == name) return p;
  throw std::out_of_range(name);
}

Datasheet with_marks(const std::vector<std::string>& names) {
  Datasheet sheet = servo();
  for (Parameter& p : sheet.parameters) p.identify = std::find(names.begin(), names.end(), p.name) != names.end();
  return sheet;
}

TEST(ParameterFit, FindsWhatTheRunWasMadeWith) {
  const Datasheet sheet = with_marks({"coulomb_friction", "compliance", "flow_coefficient"});
  SimulationSetup setup = servo_setup("prbs", 3);
  setup.parameters = servo().nominal();
  const auto set = [&](const char* name, double factor) {
    setup.parameters[static_cast<std::size_t>(sheet.parameter(name))] *= factor;
  };
  set("coulomb_friction", 1.08);
  set("compliance", 0.85);
  set("flow_coefficient", 0.97);
  const ParameterFit fit = fit_parameters(sheet, {{"prbs", simulate(sheet, setup, 8)}}, 2);
  for (const auto& [name, factor] :
       {std::pair("coulomb_friction", 1.08), std::pair("compliance", 0.85), std::pair("flow_coefficient", 0.97)}) {
    const FittedParameter& p = find(fit, name);
    EXPECT_TRUE(p.determined) << name;
    EXPECT_NEAR(p.estimate / (p.nominal * factor), 1, 0.03) << name;
    EXPECT_LT(p.low, p.nominal * factor) << name;
    EXPECT_GT(p.high, p.nominal * factor) << name;
    EXPECT_LT((p.high - p.low) / p.nominal, 0.1) << name;
  }
  ASSERT_EQ(fit.channels.size(), 6u);
  for (const ChannelMisfit& c : fit.channels) {
    EXPECT_LE(c.after, c.before * 1.01) << c.channel;
    EXPECT_LT(c.after, 2.5 * c.noise) << c.channel;
  }
}

TEST(ParameterFit, SaysWhatStandstillCannotTell) {
  const Datasheet sheet = with_marks({"moving_mass", "viscous_damping"});
  const ParameterFit fit = fit_parameters(sheet, {{"rest", simulate(sheet, servo_setup("standstill"), 3)}}, 2);
  ASSERT_EQ(fit.parameters.size(), 2u);
  for (const FittedParameter& p : fit.parameters) {
    EXPECT_FALSE(p.determined) << p.name;
    EXPECT_NEAR(p.estimate / p.nominal, 1, 0.01 * p.tolerance);
    EXPECT_NEAR(std::log(p.high / p.nominal), kNinetyPercentSigmas * p.tolerance, 0.05 * p.tolerance);
    EXPECT_FALSE(p.reason.empty());
  }
}

TEST(ParameterFit, TheAnswerDoesNotDependOnThreads) {
  const Datasheet sheet = with_marks({"coulomb_friction"});
  const Recording run = simulate(sheet, servo_setup("prbs", 5), 3);
  const ParameterFit one = fit_parameters(sheet, {{"a", run}}, 1), two = fit_parameters(sheet, {{"a", run}}, 2);
  EXPECT_EQ(one.parameters[0].estimate, two.parameters[0].estimate);
  EXPECT_EQ(one.parameters[0].high, two.parameters[0].high);
}

TEST(ParameterFit, RefusesWhatItCannotUse) {
  const Recording run = simulate(servo(), servo_setup("prbs"), 3);
  EXPECT_THROW(fit_parameters(with_marks({}), {{"a", run}}, 1), InputError);
  EXPECT_THROW(fit_parameters(servo(), {}, 1), InputError);
  EXPECT_THROW(fit_parameters(servo(), {{"a", simulate(servo(), servo_setup("prbs"), 0.2)}}, 1), InputError);
}

TEST(ParameterFit, UsesWhatABrokenRunHolds) {
  Recording run = simulate(servo(), servo_setup("prbs"), 4);
  run.values[1000 * run.columns() + column("velocity")] = std::nan("");
  for (std::size_t k = 1600; k < run.rows(); ++k) run.time[k] += 0.5;
  const ParameterFit fit = fit_parameters(with_marks({"compliance"}), {{"a", run}}, 2);
  EXPECT_EQ(fit.segments, 15u);
  ASSERT_FALSE(fit.remarks.empty());
  EXPECT_NE(fit.remarks[0].find("1 breaks"), std::string::npos) << fit.remarks[0];
  EXPECT_NEAR(fit.parameters[0].estimate / fit.parameters[0].nominal, 1, 0.05);
}

TEST(InParallel, DoesEverythingOnceAndThrowsOn) {
  for (const int jobs : {1, 3}) {
    std::vector<std::atomic<int>> done(100);
    in_parallel(done.size(), jobs, [&](std::size_t i) { ++done[i]; });
    for (const auto& count : done) EXPECT_EQ(count, 1);
    std::atomic<int> started{0};
    EXPECT_THROW(in_parallel(10000, jobs,
                             [&](std::size_t i) {
                               ++started;
                               if (i == 5) throw std::runtime_error("five");
                             }),
                 std::runtime_error);
    EXPECT_LT(started, 10000);
  }
}

}  // namespace
}  // namespace faultline
