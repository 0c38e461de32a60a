// The two observers and the signature table on the rig: the bilinear form against the plant's own equations, what can
// be decoupled, which observer sees which fault, and each fault by its name. The recordings come from the whole plant,
// off its datasheet, with noise, nuisance and a finer step.
#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "faultline/alarms/diagnosis.h"
#include "faultline/estimators/bilinear_observer.h"
#include "faultline/numerics/random.h"
#include "faultline/signal/error.h"
#include "rigs/hydraulic_drive/runs.h"

namespace faultline {
namespace {

constexpr double kOnset = 25;  // s

const StageSpec& estimator(const std::string& name) { return drive().estimators[drive().estimator(name)]; }

// Observers, their alarms and the signature table alone.
const Datasheet& table_alone() {
  static const Datasheet sheet = [] {
    Datasheet copy = drive();
    const auto keep = [](std::vector<StageSpec>& stages, const std::vector<std::string>& names) {
      std::vector<StageSpec> kept;
      for (const StageSpec& s : stages)
        for (const std::string& name : names)
          if (s.name == name) kept.push_back(s);
      stages = kept;
    };
    keep(copy.estimators, {"shaft", "line_observer", "shaft_observer"});
    keep(copy.detectors, {"line_balance", "shaft_balance"});
    keep(copy.isolators, {"shaft_fault", "second_shaft_fault", "line_fault"});
    return copy;
  }();
  return sheet;
}

TEST(BilinearDrive, ItsMatricesAreThePlantsEquations) {
  const auto model = make_bilinear_model("bilinear_drive", drive(), estimator("line_observer").settings);
  const EffectSet effects(drive(), {}, 1e-3, 1);
  Random random(1);
  for (int k = 0; k < 200; ++k) {
    // Any parameters, any point with the spool on its voltage's side.
    std::vector<double> parameters = drive().nominal();
    for (double& p : parameters) p *= random.uniform(0.7, 1.4);
    const auto plant = find_rig_type("hydraulic_drive")->make(drive(), parameters, effects);
    const double side = k % 4 == 0 ? -1 : 1;
    const Eigen::Vector4d x(random.uniform(-2e-4, 2e-4), side * random.uniform(1e-6, 2e-4), random.uniform(0, 9e6),
                            random.uniform(-20, 120));
    std::vector<double> channels(drive().channels.size(), 0);
    channels[drive_column("valve_voltage")] = side * random.uniform(0.01, 2);
    channels[drive_column("supply_pressure")] = random.uniform(1.2e7, 1.5e7);
    channels[drive_column("pump_pressure")] = random.uniform(1.5e6, 5e6);
    channels[drive_column("motor_pressure")] = x[2];
    channels[drive_column("shaft_speed")] = x[3];
    Eigen::Vector4d rate;
    plant->derivative(0, x.data(), channels.data(), rate.data());

    const BilinearSystem s = model->system(parameters);
    Eigen::Vector3d u;
    model->take_inputs(channels.data(), u.data());
    Eigen::Matrix4d a = s.a;
    for (std::size_t i = 0; i < s.products.size(); ++i)
      if (s.products[i].size() > 0) a += u[static_cast<Eigen::Index>(i)] * s.products[i];
    const Eigen::Vector4d ours = a * x + s.b * u;
    for (int i = 0; i < 4; ++i) {
      const double size =
          (a.row(i).transpose().cwiseProduct(x)).cwiseAbs().sum() + s.b.row(i).cwiseAbs().dot(u.cwiseAbs());
      EXPECT_NEAR(ours[i], rate[i], 1e-9 * size) << i;
    }
    EXPECT_EQ((s.c * x)[0], x[2]);
    EXPECT_EQ((s.c * x)[1], x[3]);
  }
}

TEST(BilinearDrive, WhatCanBeDecoupled) {
  // The torques: yes, with the valve's root among the coefficients of the error. The line: strictly. Both: no.
  const BilinearObserver line(drive(), estimator("line_observer")), shaft(drive(), estimator("shaft_observer"));
  EXPECT_FALSE(line.decoupling().strict);
  EXPECT_EQ(line.decoupling().varying, std::vector<int>{1});
  EXPECT_TRUE(shaft.decoupling().strict);
  EXPECT_EQ(line.innovation_names(), std::vector<std::string>{"motor_pressure"});
  EXPECT_EQ(shaft.innovation_names(), std::vector<std::string>{"shaft_speed"});
  StageSpec both = estimator("line_observer");
  both.settings.set("unknown", std::string("shaft_speed, motor_pressure"));
  EXPECT_THROW(BilinearObserver(drive(), both), InputError);
  both.settings.set("unknown", std::string("spool_position"));
  EXPECT_THROW(BilinearObserver(drive(), both), InputError);
}

// Mean of the normalised innovation squared before and from 1 s after the fault begins.
std::pair<double, double> before_and_after(const std::string& stage_name, const std::string& effect) {
  SimulationSetup setup = drive_off_nominal("paper", 7);
  setup.effects.push_back(parse_effect(effect + ",from=25"));
  const Recording r = simulate(drive(), setup, 45);
  EstimatorStage stage(drive(), estimator(stage_name));
  Estimate estimate;
  double before = 0, after = 0, n = 0, m = 0;
  for (std::size_t k = 0; k < r.rows(); ++k) {
    stage.process(r.sample(k), estimate);
    if (estimate.observed == 0) continue;
    if (r.time[k] < kOnset) before += estimate.normalised_innovation, ++n;
    if (r.time[k] > kOnset + 1) after += estimate.normalised_innovation, ++m;
  }
  EXPECT_GT(n, 800);
  return {before / n, after / m};
}

TEST(DriveObservers, EachSeesItsOwnPartOnly) {
  const std::vector<std::pair<std::string, double>> on_shaft = {{"scale@transmission.motor:factor=1.1", 100},
                                                                {"scale@transmission.pump:factor=0.909", 100},
                                                                {"viscous_friction@force.shaft:coefficient=1.37e-3", 4},
                                                                {"added_mass@force.shaft:mass=1.56e-4", 1.2},
                                                                {"coulomb_friction@force.shaft:force=0.2", 10}};
  for (const auto& [effect, least] : on_shaft) {
    const auto shaft = before_and_after("shaft_observer", effect);
    EXPECT_LT(shaft.first, 1.5) << effect;
    EXPECT_GT(shaft.second, least * shaft.first) << effect;
    const auto line = before_and_after("line_observer", effect);
    EXPECT_LT(line.second, 1.2 * line.first) << effect;
  }
  const std::vector<std::pair<std::string, double>> on_line = {
      {"clogging@restriction.valve:fraction=-0.1", 100},
      {"laminar_leakage@flow.motor_in_motor_out:coefficient=1.5e-13", 2},
      {"compliance_factor@compliance.motor_line:factor=0.909", 1.3}};
  for (const auto& [effect, least] : on_line) {
    const auto line = before_and_after("line_observer", effect);
    EXPECT_LT(line.first, 1.5) << effect;
    EXPECT_GT(line.second, least * line.first) << effect;
    const auto shaft = before_and_after("shaft_observer", effect);
    EXPECT_LT(shaft.second, 1.2 * shaft.first) << effect;
  }
}

AlarmReport diagnosed(const std::vector<std::string>& effects, std::uint64_t seed, double duration = 45) {
  SimulationSetup setup = drive_off_nominal("paper", seed);
  for (const std::string& effect : effects) setup.effects.push_back(parse_effect(effect));
  const Recording r = simulate(drive(), setup, duration);
  Diagnosis diagnosis(table_alone());
  for (std::size_t k = 0; k < r.rows(); ++k) diagnosis.process(r.sample(k));
  return diagnosis.report();
}

TEST(DriveSignatures, ThePapersShaftFaultsByNameWithin250Samples) {
  const std::vector<std::tuple<std::string, std::string, double>> faults = {
      {"scale@transmission.motor", "factor=1.1", 1.1},
      {"scale@transmission.pump", "factor=0.9090909", 0.9090909},
      {"scale@transmission.displacement", "factor=1.1", 1.1},
      {"added_mass@force.shaft", "mass=1.5606e-4", 1.5606e-4},
      {"viscous_friction@force.shaft", "coefficient=1.3733e-3", 1.3733e-3}};
  for (const auto& [name, size, value] : faults) {
    const AlarmReport report = diagnosed({name + ":" + size + ",from=25"}, 31);
    const Alarm* named = nullptr;
    for (const Alarm& a : report.alarms) {
      if (a.effect.empty()) continue;
      EXPECT_EQ(a.effect + "@" + a.port, name);
      named = &a;
    }
    ASSERT_TRUE(named) << name;
    EXPECT_TRUE(named->active);
    EXPECT_LE(named->raised, kOnset + 2.5) << name;
    EXPECT_GE(named->raised, kOnset);
    EXPECT_NEAR(named->size, value, name[0] == 's' ? 0.012 : 0.2 * value) << name;
    EXPECT_TRUE(named->equivalent.empty()) << name;
  }
}

TEST(DriveSignatures, FaultsOutsideTheShaftAreTheLines) {
  // Raised within 250 samples; the line's own table names them, those of the shaft nothing. Sizes as absolute errors.
  const std::vector<std::tuple<std::string, std::string, double, double>> faults = {
      {"clogging@restriction.valve", "fraction=-0.1", -0.1, 0.01},
      {"compliance_factor@compliance.motor_line", "factor=0.9090909", 0.9090909, 0.02},
      {"compliance_factor@compliance.motor_line", "factor=1.1", 1.1, 0.02},
      {"laminar_leakage@flow.motor_in_motor_out", "coefficient=3e-13", 3e-13, 1.6e-13}};
  for (const auto& [name, size, value, error] : faults) {
    const AlarmReport report = diagnosed({name + ":" + size + ",from=25"}, 32);
    ASSERT_FALSE(report.alarms.empty()) << name;
    EXPECT_GE(report.alarms[0].raised, kOnset) << name;
    EXPECT_LE(report.alarms[0].raised, kOnset + 2.5) << name;
    const Alarm& last = report.alarms.back();
    EXPECT_TRUE(last.active);
    EXPECT_EQ(last.effect + "@" + last.port, name);
    EXPECT_NEAR(last.size, value, error) << name;
    EXPECT_LE(last.low, value) << name;
    EXPECT_GE(last.high, value) << name;
  }
}

TEST(DriveSignatures, OneFaultAfterTheOtherKeepsBothNames) {
  const AlarmReport report = diagnosed(
      {"scale@transmission.motor:factor=1.1,from=25", "scale@transmission.pump:factor=0.9090909,from=40"}, 33, 55);
  std::vector<std::string> active;
  for (const Alarm& a : report.alarms)
    if (a.active && !a.effect.empty()) active.push_back(a.effect + "@" + a.port);
  EXPECT_EQ(active, (std::vector<std::string>{"scale@transmission.motor", "scale@transmission.pump"}));
}

TEST(DriveSignatures, HealthyRigsAreSilent) {
  for (const std::uint64_t seed : {41, 42, 43}) EXPECT_TRUE(diagnosed({}, seed, 120).alarms.empty()) << seed;
}

TEST(DriveSignatures, GapsAndBadSamplesRaiseNothingOfTheRig) {
  const Recording r = simulate(drive(), drive_off_nominal("paper", 44), 60);
  Diagnosis diagnosis(table_alone());
  Random random(3);
  for (std::size_t k = 0; k < r.rows(); ++k) {
    if (k > 2500 && k < 2506) continue;  // a short gap
    if (k > 4000 && k < 4200) continue;  // a long one: the stages begin anew
    Sample s = r.sample(k);
    if (random.uniform() < 0.002) s.values[drive_column("motor_pressure")] = std::nan("");
    diagnosis.process(s);
  }
  for (const Alarm& a : diagnosis.report().alarms) EXPECT_EQ(a.kind, AlarmKind::data) << a.text;
}

}  // namespace
}  // namespace faultline
