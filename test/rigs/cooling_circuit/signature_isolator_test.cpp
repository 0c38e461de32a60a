// Isolation by signatures on the simulated cooling circuit: place, size, delay; silence; what cannot be told apart;
// reset, pauses. Settings are the datasheet's; the seeds here are none of those that they were chosen with
// (docs/cooling_circuit.md).
#include <gtest/gtest.h>

#include <algorithm>

#include <fmt/format.h>

#include "count_allocations.h"
#include "faultline/alarms/diagnosis.h"
#include "faultline/isolation/balance_model.h"
#include "faultline/signal/error.h"
#include "rigs/cooling_circuit/recordings.h"

namespace faultline {
namespace {

constexpr double kFrom = 6;  // s

struct Answer {
  std::vector<Alarm> found;                   // by isolation: neither redlines nor data
  std::size_t redlines = 0, innovations = 0;  // and what the Kalman filter says
};

Answer diagnose(const std::string& effect, std::uint64_t seed, double duration = 8,
                const std::string& profile = "steady", const Datasheet& rig = cooling()) {
  Simulator simulator(rig, cooling_recording(profile, seed, effect));
  Diagnosis diagnosis(cooling());
  for (int k = 0; k < static_cast<int>(duration * 1000); ++k) diagnosis.process(simulator.step());
  Answer answer;
  for (const Alarm& alarm : diagnosis.report().alarms)
    if (alarm.text.rfind("Redline", 0) == 0)
      ++answer.redlines;
    else if (alarm.kind == AlarmKind::model)
      ++answer.innovations;
    else
      answer.found.push_back(alarm);
  return answer;
}

struct Fault {
  const char* effect;
  const char* port;
  const char* size_name;
  double size;
  AlarmKind kind;
};

void PrintTo(const Fault& f, std::ostream* out) { *out << f.effect << "@" << f.port; }

class GrossFault : public ::testing::TestWithParam<Fault> {};

TEST_P(GrossFault, IsNamedAtItsPlaceWithItsSizeWithinTwelveSamples) {
  const Fault& f = GetParam();
  const Answer answer = diagnose(fmt::format("{}@{}:{}={},from={}", f.effect, f.port, f.size_name, f.size, kFrom), 301);
  ASSERT_EQ(answer.found.size(), 1u);
  const Alarm& alarm = answer.found[0];
  EXPECT_EQ(alarm.kind, f.kind);
  EXPECT_EQ(alarm.effect, f.effect);
  EXPECT_EQ(alarm.port, f.port);
  EXPECT_TRUE(alarm.equivalent.empty()) << alarm.text;
  EXPECT_NEAR(alarm.since, kFrom, 0.005);
  EXPECT_LE(alarm.raised - kFrom, 0.012 + 1e-6);
  EXPECT_TRUE(alarm.active);
  EXPECT_EQ(alarm.size_name, f.size_name);
  EXPECT_LE(alarm.low, f.size);
  EXPECT_GE(alarm.high, f.size);
  EXPECT_LT(alarm.high - alarm.low, 0.25 * std::abs(f.size));
}

INSTANTIATE_TEST_SUITE_P(
    All, GrossFault,
    ::testing::Values(Fault{"orifice_leakage", "flow.m_outlet_ambient", "coefficient", 2e-7, AlarmKind::fault},
                      Fault{"orifice_leakage", "flow.t_outlet_ambient", "coefficient", 2e-7, AlarmKind::fault},
                      Fault{"orifice_leakage", "flow.v3_inlet_ambient", "coefficient", 2e-7, AlarmKind::fault},
                      Fault{"orifice_leakage", "flow.v1_drain_ambient", "coefficient", 2e-7, AlarmKind::fault},
                      Fault{"clogging", "restriction.v2_orifice", "fraction", 0.2, AlarmKind::fault},
                      Fault{"clogging", "restriction.t_feed", "fraction", 0.2, AlarmKind::fault},
                      Fault{"clogging", "restriction.m_drain", "fraction", 0.2, AlarmKind::fault},
                      Fault{"offset", "sensor.v1_inlet_pressure", "value", 5e4, AlarmKind::sensor},
                      Fault{"offset", "sensor.v3_outlet_pressure", "value", -5e4, AlarmKind::sensor},
                      Fault{"offset", "sensor.t_mass_flow", "value", 0.1, AlarmKind::sensor},
                      Fault{"offset", "sensor.m_inlet_temperature", "value", 5, AlarmKind::sensor},
                      Fault{"offset", "sensor.v2_outlet_temperature", "value", 4, AlarmKind::sensor},
                      Fault{"offset", "sensor.t_inlet_pressure", "value", 5e4, AlarmKind::sensor}),
    [](const auto& tested) {
      std::string name = std::string(tested.param.effect) + "_" + tested.param.port;
      std::replace(name.begin(), name.end(), '.', '_');
      return name;
    });

TEST(Isolation, HealthyRunsAreSilent) {
  for (const std::uint64_t seed : {311, 312, 313}) {
    const Answer answer = diagnose("", seed, 15);
    EXPECT_TRUE(answer.found.empty()) << seed << " " << answer.found[0].text;
    EXPECT_EQ(answer.redlines, 0u);
    EXPECT_EQ(answer.innovations, 0u);
  }
  const Answer moving = diagnose("", 314, 20, "valve_cycle");
  EXPECT_TRUE(moving.found.empty()) << moving.found[0].text;
  EXPECT_EQ(moving.innovations, 0u);
}

// Transducers twice as noisy as their datasheet says, from the first sample on: a rig in good order, also while its
// valve is shut and shows no noise of the flow meters.
TEST(Isolation, ARigsOwnNoiseIsNoFault) {
  Datasheet noisier = cooling();
  for (Channel& channel : noisier.channels) channel.noise_std *= 2;
  for (const char* profile : {"steady", "paper", "valve_cycle"}) {
    const Answer healthy = diagnose("", 341, 20, profile, noisier);
    EXPECT_TRUE(healthy.found.empty()) << profile << " " << healthy.found[0].text;
    EXPECT_EQ(healthy.innovations, 0u) << profile;
  }
  const Answer leak =
      diagnose("orifice_leakage@flow.t_outlet_ambient:coefficient=5e-8,from=6", 342, 12, "steady", noisier);
  ASSERT_EQ(leak.found.size(), 1u);
  EXPECT_EQ(leak.found[0].port, "flow.t_outlet_ambient");
  EXPECT_NEAR(leak.found[0].size, 5e-8, 3e-9);
}

// A supply that leaves its redline takes 25 others with it, and what a cause does stands under the cause.
TEST(Isolation, OneCauseIsOneAlarm) {
  Datasheet wandering = cooling();
  for (InputSignal& input : wandering.inputs)
    if (input.channel == "supply_pressure") input.wander_std = 4e5, input.wander_low = 0.02, input.wander_high = 0.1;
  const Answer supply = diagnose("", 351, 30, "steady", wandering);
  EXPECT_TRUE(supply.found.empty()) << supply.found[0].text;
  EXPECT_GE(supply.redlines, 1u);
  EXPECT_LE(supply.redlines, 4u);
  const Answer clogged = diagnose("clogging@restriction.m_feed:fraction=0.28,from=6", 352, 12);
  ASSERT_EQ(clogged.found.size(), 1u);
  EXPECT_EQ(clogged.found[0].effect, "clogging");
  EXPECT_EQ(clogged.redlines + clogged.innovations, 0u);
}

// Balances are judged in steady operation: where there was none, no fault found says nothing.
TEST(Isolation, WithoutSteadyOperationNothingIsJudged) {
  Simulator simulator(cooling(), cooling_recording("both_multisine", 361));
  Diagnosis diagnosis(cooling());
  for (int k = 0; k < 15000; ++k) diagnosis.process(simulator.step());
  EXPECT_FALSE(diagnosis.report().judged);
  Simulator steady(cooling(), cooling_recording("steady", 362));
  Diagnosis judged(cooling());
  for (int k = 0; k < 8000; ++k) judged.process(steady.step());
  EXPECT_TRUE(judged.report().judged);
}

TEST(Isolation, ASmallLeakIsNamedWhileRedlinesAreSilent) {
  const Answer answer = diagnose("orifice_leakage@flow.t_outlet_ambient:coefficient=1.28e-8,from=6,to=11", 321, 13);
  EXPECT_EQ(answer.redlines, 0u);
  ASSERT_EQ(answer.found.size(), 1u);
  EXPECT_EQ(answer.innovations, 1u);  // of T, and of no other
  EXPECT_EQ(answer.found[0].effect, "orifice_leakage");
  EXPECT_EQ(answer.found[0].port, "flow.t_outlet_ambient");
  EXPECT_LT(answer.found[0].raised, 10);
  EXPECT_LE(answer.found[0].low, 1.28e-8);
  EXPECT_GE(answer.found[0].high, 1.28e-8);
}

TEST(Isolation, WhatOnlyTheValveSeesIsToldAsASet) {
  const Answer answer = diagnose("droop@source.supply:resistance=6e7,from=6,to=7", 322, 9);
  ASSERT_FALSE(answer.found.empty());
  std::vector<std::string> named = answer.found[0].equivalent;
  std::sort(named.begin(), named.end());
  EXPECT_EQ(named, (std::vector<std::string>{"clogging@restriction.bench_valve", "droop@source.supply",
                                             "offset@sensor.supply_pressure"}));
  EXPECT_EQ(answer.found[0].kind, AlarmKind::unknown);  // no one of three is likelier than not
  EXPECT_NE(answer.found[0].text.find("candidates"), std::string::npos) << answer.found[0].text;
  EXPECT_LT(answer.found[0].confidence, 0.5);
}

TEST(Isolation, HeatFromAllWallsTakesTheTimeOfTheFiring) {
  const Answer answer = diagnose("scale@command.heat_load_command:factor=1.3,from=6", 334);
  ASSERT_EQ(answer.found.size(), 1u);
  EXPECT_EQ(answer.found[0].effect, "scale");
  EXPECT_EQ(answer.found[0].port, "command.heat_load_command");
  EXPECT_LT(answer.found[0].raised, 6.08);
  EXPECT_LE(answer.found[0].low, 1.3);
  EXPECT_GE(answer.found[0].high, 1.3);
}

TEST(Isolation, WallHeatAndThermocoupleAreToldApartByTheirStep) {
  const Answer wall = diagnose("scale@heat.v3_wall:factor=1.3,from=6", 335);
  ASSERT_EQ(wall.found.size(), 1u);
  EXPECT_EQ(wall.found[0].port, "heat.v3_wall");
  EXPECT_TRUE(wall.found[0].equivalent.empty());
  const Answer slow = diagnose("scale@heat.v3_wall:factor=1.3,from=6,to=7.5", 336);
  ASSERT_EQ(slow.found.size(), 1u);
  EXPECT_EQ(slow.found[0].equivalent.size(), 1u);  // grown slowly it may be either
}

TEST(Isolation, SensorsThatSpeakForThemselves) {
  // A converter that hangs gives the very same number; the simulator's stuck transducer still has its noise.
  Simulator simulator(cooling(), cooling_recording("steady", 331));
  Diagnosis diagnosis(cooling());
  double held = 0;
  const auto flow = static_cast<std::size_t>(cooling().channel("v2_mass_flow"));
  for (int k = 0; k < 8000; ++k) {
    Sample sample = simulator.step();
    if (k < 6000) held = sample.values[flow];
    sample.values[flow] = held;
    diagnosis.process(sample);
  }
  const std::vector<Alarm> stuck = diagnosis.report().alarms;
  ASSERT_EQ(stuck.size(), 1u);
  EXPECT_EQ(stuck[0].effect, "stuck");
  EXPECT_EQ(stuck[0].port, "sensor.v2_mass_flow");
  EXPECT_LE(stuck[0].raised, 6.012);
  const Answer noisy = diagnose("noise@sensor.t_mass_flow:std=0.03,from=6", 332);
  ASSERT_EQ(noisy.found.size(), 1u) << noisy.found[1].text;
  EXPECT_EQ(noisy.found[0].effect, "noise");
  EXPECT_EQ(noisy.found[0].port, "sensor.t_mass_flow");
  EXPECT_LT(noisy.found[0].raised, 6.02);
  EXPECT_NEAR(noisy.found[0].size, 0.03, 0.003);
}

TEST(Isolation, CavitationIsARippleWithItsAmplitude) {
  const Answer answer = diagnose("ripple@source.v3_drain:amplitude=2e5,frequency=30,from=6", 333, 9);
  const auto found = std::find_if(answer.found.begin(), answer.found.end(),
                                  [](const Alarm& a) { return a.effect == "ripple" && a.port == "source.v3_drain"; });
  ASSERT_NE(found, answer.found.end());
  EXPECT_LT(found->raised, 6.15);
  EXPECT_NEAR(found->size, 2e5, 3e4);
  for (const Alarm& alarm : answer.found)
    if (&alarm != &*found) {
      EXPECT_EQ(alarm.kind, AlarmKind::unknown);  // before it has swung it may be anything; no wrong name
      EXPECT_LT(alarm.until - alarm.since, 2);
    }
}

// ---- the isolator by itself

StageSpec spec() { return cooling().isolators.front(); }

TEST(SignatureIsolator, RefusesUnknownModelsAndMissingSettings) {
  StageSpec other = spec();
  other.type = "oracle";
  EXPECT_THROW(make_isolator(cooling(), other), InputError);
  other = spec();
  other.settings = Settings("test", {}, {}, {{"model", "cooling_circuit"}});
  EXPECT_THROW(make_isolator(cooling(), other), InputError);
  EXPECT_THROW(make_balance_model("weather", cooling(), spec().settings), InputError);
}

TEST(SignatureIsolator, ResetIsCompleteAndASampleAllocatesNothingWhileAllIsWell) {
  const auto isolator = make_isolator(cooling(), spec());
  EstimatorStage stage(cooling(), cooling().estimators.front());
  Simulator simulator(cooling(), cooling_recording("steady", 5));
  std::vector<Estimate> estimates;
  Estimate estimate;
  for (int k = 0; k < 7000; ++k) {
    stage.process(simulator.step(), estimate);
    if (k == 0 || k >= 3500) estimates.push_back(estimate);
  }
  const std::vector<bool> doubted(cooling().channels.size(), false);
  Finding finding;
  for (const Estimate& e : estimates) isolator->process(e, doubted, finding);
  EXPECT_FALSE(finding.active);
  const std::uint64_t before = allocations();
  for (std::size_t k = 1; k < estimates.size(); ++k) isolator->process(estimates[k], doubted, finding);
  EXPECT_EQ(allocations() - before, 0u);

  // A leak learnt as normal before the reset is nothing new after it.
  isolator->reset();
  finding = Finding();
  for (Estimate e : estimates) {
    for (Quantity& q : e.quantities)
      if (q.name == "t_mass_flow") q.value *= 0.9;
    isolator->process(e, doubted, finding);
  }
  EXPECT_FALSE(finding.active);
}

double largest(const std::vector<double>& values) {
  double most = 0;
  for (const double value : values) most = std::max(most, std::abs(value));
  return most;
}

// Features of the reference point: branches alike but for the nozzle, the last.
std::vector<double> features_of(std::size_t branches) {
  std::vector<double> features;
  for (std::size_t b = 0; b + 1 < branches; ++b) features.insert(features.end(), {45e5, 43.9e5, 1.5, 288, 24, 1.6e-4});
  features.insert(features.end(), {45e5, 34.6e5, 2.0, 288, 24, 1.6e-4});
  features.insert(features.end(), {70e5, 1});
  return features;
}

std::size_t hypothesis_at(const std::vector<Hypothesis>& all, const std::string& port) {
  const auto found = std::find_if(all.begin(), all.end(), [&](const Hypothesis& h) { return h.port == port; });
  EXPECT_NE(found, all.end()) << port;
  return static_cast<std::size_t>(found - all.begin());
}

TEST(CoolingBalances, TheRightHypothesisOfTheRightSizeLeavesNothing) {
  const auto model = make_balance_model("cooling_circuit", cooling(), spec().settings);
  const std::vector<double> features = features_of(5);
  const std::size_t n = model->residuals().size();
  std::vector<double> reference(n), r(n);
  model->reference(features.data(), reference.data());
  const std::vector<Hypothesis> all = model->hypotheses();
  for (std::size_t h = 0; h < all.size(); ++h) {
    // With no size nothing is left either; a size of its own leaves something: the hypothesis is not empty.
    model->residuals(features.data(), reference.data(), static_cast<int>(h), 0, r.data());
    EXPECT_LT(largest(r), 1e-12) << all[h].effect << "@" << all[h].port;
    model->residuals(features.data(), reference.data(), static_cast<int>(h), 20 * all[h].unit, r.data());
    EXPECT_GT(largest(r), 1e-4) << all[h].effect << "@" << all[h].port;
  }
  // A meter of the second branch that reads 0.05 kg/s too much. Its flow cancels in the heat balance, but theta_Q
  // follows the meter.
  const double off = 0.05, truth = 1.5;
  std::vector<double> metered = features;
  metered[6 * 1 + 2] += off;
  metered[6 * 1 + 5] /= (truth + off) / truth;
  model->residuals(metered.data(), reference.data(), static_cast<int>(hypothesis_at(all, "sensor.v1_mass_flow")), off,
                   r.data());
  for (std::size_t i = 0; i < n; ++i) EXPECT_NEAR(r[i], 0, 1e-12) << model->residuals()[i];
  model->residuals(metered.data(), reference.data(), -1, 0, r.data());
  EXPECT_NEAR(r[5 * 1 + 0], 0.875 * std::log((truth + off) / truth), 1e-12);  // as measured the tube balance shows it
}

// The datasheet with further branches like the second.
Datasheet with_branches(std::size_t count) {
  Datasheet sheet = cooling();
  const std::string pattern = "v1_";
  while (sheet.branches.size() < count) {
    const std::string name = fmt::format("w{}", sheet.branches.size());
    sheet.branches.push_back(name);
    const auto copy_all = [&](auto& list) {
      const auto known = list;
      for (auto entry : known) {
        if (entry.name.rfind(pattern, 0) != 0) continue;
        entry.name = name + "_" + entry.name.substr(pattern.size());
        list.push_back(entry);
      }
    };
    copy_all(sheet.channels);
    copy_all(sheet.parameters);
    const std::vector<Port> ports = sheet.ports;
    for (Port port : ports) {
      const std::size_t place = port.name.find("." + pattern);
      if (place == std::string::npos) continue;
      port.name.replace(place + 1, pattern.size(), name + "_");
      if (!port.channel.empty()) port.channel = port.name.substr(place + 1);
      sheet.ports.push_back(port);
    }
  }
  return sheet;
}

TEST(CoolingBalances, HaveTheFaultsThatTheDatasheetLists) {
  const std::vector<FaultHypothesis> listed = fault_hypotheses(cooling());
  const std::vector<Hypothesis> all = make_balance_model("cooling_circuit", cooling(), spec().settings)->hypotheses();
  EXPECT_EQ(all.size(), 12u * 5 + 6);
  for (const Hypothesis& h : all) {
    const std::string name = h.effect + "@" + h.port;
    const auto found =
        std::find_if(listed.begin(), listed.end(), [&](const FaultHypothesis& f) { return f.name() == name; });
    ASSERT_NE(found, listed.end()) << name;
    EXPECT_EQ(h.kind, found->kind) << name;
    if (h.size_name != found->size_name) continue;  // of water balances see what has come of it
    EXPECT_EQ(h.size_unit, found->size_unit) << name;
    EXPECT_GE(h.shown_from + h.high, std::max(found->size(found->highest), found->size(found->lowest))) << name;
    EXPECT_LE(h.shown_from + h.low, std::min(found->size(found->highest), found->size(found->lowest))) << name;
  }
  // One that the datasheet does not list is none of the isolator's either.
  Datasheet without = cooling();
  for (Port& port : without.ports)
    if (port.name == "source.supply") port.effects.clear();
  const std::vector<Hypothesis> less = make_balance_model("cooling_circuit", without, spec().settings)->hypotheses();
  EXPECT_EQ(less.size(), all.size() - 1);
  for (const Hypothesis& h : less) EXPECT_NE(h.port, "source.supply");
}

TEST(CoolingBalances, TakeAnyNumberOfBranches) {
  constexpr std::size_t kBranches = 40;
  const auto model = make_balance_model("cooling_circuit", with_branches(kBranches), spec().settings);
  const std::vector<double> features = features_of(kBranches);
  const std::size_t n = model->residuals().size();
  ASSERT_EQ(n, 5 * kBranches + 1);
  ASSERT_EQ(model->features().size(), features.size());
  std::vector<double> reference(n), r(n);
  model->reference(features.data(), reference.data());
  const std::vector<Hypothesis> all = model->hypotheses();
  const double fraction = 0.1;
  for (const std::string& branch : with_branches(kBranches).branches) {
    const std::size_t h = hypothesis_at(all, fmt::format("restriction.{}_feed", branch));
    model->residuals(features.data(), reference.data(), static_cast<int>(h), fraction, r.data());
    std::size_t shows = 0;
    for (std::size_t i = 0; i < n; ++i)
      if (std::abs(r[i]) > std::abs(r[shows])) shows = i;
    EXPECT_EQ(model->residuals()[shows], branch + "_feed");
    // A feed that is open by less passed its flow with a lower coefficient; the manifold pressure goes up a little
    // for all.
    EXPECT_NEAR(r[shows], -std::log(1 - fraction), 0.01);
  }
}

}  // namespace
}  // namespace faultline
