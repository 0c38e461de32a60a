// Recordings that are not what they say: what is told instead of a fault, on simulated runs of a healthy rig that is
// off its datasheet.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <random>

#include "config_folder.h"
#include "detectors/estimates.h"
#include "faultline/alarms/diagnosis.h"

namespace faultline {
namespace {

using Change = std::function<void(Recording&, std::size_t row)>;

double& at(Recording& r, std::size_t row, const std::string& channel) {
  return r.values[row * r.columns() + static_cast<std::size_t>(find_channel(r.channels, channel))];
}

struct Told {
  Verdict verdict;
  AlarmReport report;
};

Told diagnosed(const Change& change, double seconds = 20, const SimulationSetup& setup = off_nominal("steps", 3)) {
  Recording r = simulate(servo(), setup, seconds);
  for (std::size_t k = 0; k < r.rows(); ++k) change(r, k);
  Diagnosis diagnosis(servo());
  for (std::size_t k = 0; k < r.rows(); ++k) diagnosis.process(r.sample(k));
  return {verdict_of(diagnosis.report(), 0, seconds), diagnosis.report()};
}

void expect_no_fault(const AlarmReport& report) {
  for (const Alarm& alarm : report.alarms) EXPECT_NE(alarm.kind, AlarmKind::fault) << alarm.text;
}

TEST(BadData, AFrozenTransducerIsNamedAndNoFaultRestsOnIt) {
  const Told told = diagnosed([](Recording& r, std::size_t k) {
    if (k > 10000) at(r, k, "load_force") = at(r, 10000, "load_force");
  });
  EXPECT_EQ(told.verdict.kind, VerdictKind::sensor) << told.verdict.sentence;
  EXPECT_NE(told.verdict.sentence.find("load_force"), std::string::npos) << told.verdict.sentence;
  EXPECT_NE(told.verdict.sentence.find("stuck"), std::string::npos) << told.verdict.sentence;
  EXPECT_NEAR(told.report.alarms.front().since, 10, 0.15);
  expect_no_fault(told.report);
}

TEST(BadData, NoiseThatReachesBeyondTheRangeIsOneAlarm) {
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 1.5e6);
  const Told told = diagnosed([&](Recording& r, std::size_t k) {
    if (k > 10000) at(r, k, "chamber_a_pressure") += noise(random);
  });
  const auto& alarms = told.report.alarms;
  EXPECT_LE(std::count_if(
                alarms.begin(), alarms.end(),
                [](const Alarm& a) { return a.port == "sensor.chamber_a_pressure" && a.kind != AlarmKind::unknown; }),
            2);  // the first reading beyond the range comes before a block of them is judged
  EXPECT_TRUE(
      std::any_of(alarms.begin(), alarms.end(), [](const Alarm& a) { return a.effect == "noise" && a.active; }));
}

TEST(BadData, ATransducerThatLostItsCableIsNotHealthy) {
  for (const double dead : {0.0, 1e7}) {  // the ends of the range
    const Told told = diagnosed([&](Recording& r, std::size_t k) {
      if (k > 10000) at(r, k, "chamber_a_pressure") = dead;
    });
    EXPECT_NE(told.verdict.kind, VerdictKind::healthy) << told.verdict.sentence;
    EXPECT_TRUE(std::any_of(told.report.alarms.begin(), told.report.alarms.end(), [](const Alarm& a) {
      return a.active && a.port == "sensor.chamber_a_pressure" && a.text.find("end of its range") != std::string::npos;
    })) << told.verdict.sentence;
    expect_no_fault(told.report);
  }
}

TEST(BadData, AWrongSignOfTheCommandFitsNoModel) {
  const Datasheet drive = find_datasheet(config_folder(), "hydraulic_drive");
  SimulationSetup setup;
  setup.profile = "paper";
  Recording r = simulate(drive, setup, 30);
  Diagnosis diagnosis(drive);
  for (std::size_t k = 0; k < r.rows(); ++k) {
    at(r, k, "valve_voltage") *= -1;
    diagnosis.process(r.sample(k));
  }
  EXPECT_EQ(verdict_of(diagnosis.report(), 0, 30).kind, VerdictKind::unknown);
}

TEST(BadData, PressuresInAnotherUnitAreDataNotAFault) {
  for (const double unit : {1e5, 1e3, 6894.76}) {
    const Told told = diagnosed([&](Recording& r, std::size_t k) {
      for (std::size_t c = 0; c < r.columns(); ++c)
        if (r.channels[c].unit == "Pa") r.values[k * r.columns() + c] /= unit;
    });
    EXPECT_EQ(told.verdict.kind, VerdictKind::data) << told.verdict.sentence;
    EXPECT_NE(told.verdict.sentence.find("unit"), std::string::npos) << told.verdict.sentence;
    expect_no_fault(told.report);
  }
}

TEST(BadData, ExchangedChannelsAreNamedAndATurnedSignIsNoFault) {
  const Told turned = diagnosed([](Recording& r, std::size_t k) { at(r, k, "position") *= -1; });
  EXPECT_TRUE(turned.verdict.kind == VerdictKind::data || turned.verdict.kind == VerdictKind::unknown)
      << turned.verdict.sentence;
  EXPECT_NE(turned.verdict.sentence.find("position"), std::string::npos) << turned.verdict.sentence;
  expect_no_fault(turned.report);
  const Told exchanged = diagnosed(
      [](Recording& r, std::size_t k) { std::swap(at(r, k, "chamber_a_pressure"), at(r, k, "chamber_b_pressure")); });
  EXPECT_NE(exchanged.verdict.sentence.find("chamber_a_pressure and chamber_b_pressure are exchanged"),
            std::string::npos)
      << exchanged.verdict.sentence;
}

TEST(BadData, AnotherBuildIsTheParameterAndAFaultFromTheBeginningIsNot) {
  const auto nothing = [](Recording&, std::size_t) {};
  SimulationSetup setup = off_nominal("steps", 3);
  setup.parameters[static_cast<std::size_t>(servo().parameter("ram_area"))] *= 1.5;
  const Told other = diagnosed(nothing, 20, setup);
  EXPECT_EQ(other.verdict.kind, VerdictKind::data) << other.verdict.sentence;
  EXPECT_EQ(other.verdict.sentence.find("ram_area: 1."), 0u) << other.verdict.sentence;
  expect_no_fault(other.report);
  SimulationSetup faulty = off_nominal("steps", 3);
  faulty.effects.push_back(parse_effect("clogging@restriction.valve:fraction=0.3"));
  const Told fault = diagnosed(nothing, 20, faulty);
  EXPECT_EQ(fault.verdict.kind, VerdictKind::fault) << fault.verdict.sentence;
}

// Without the samples from `lost` on, for `gap` s.
AlarmReport diagnosed_without(const Datasheet& sheet, const Recording& r, double lost, double gap) {
  Diagnosis diagnosis(sheet);
  for (std::size_t k = 0; k < r.rows(); ++k)
    if (r.time[k] < lost || r.time[k] >= lost + gap) diagnosis.process(r.sample(k));
  return diagnosis.report();
}

// One alarm of that name, that goes on to the end.
void expect_one(const AlarmReport& report, const std::string& effect, const std::string& port, double since) {
  std::size_t count = 0;
  for (const Alarm& alarm : report.alarms) {
    EXPECT_TRUE(alarm.kind == AlarmKind::fault || alarm.level == AlarmLevel::stale) << alarm.text;
    if (alarm.kind != AlarmKind::fault) continue;
    ++count;
    EXPECT_EQ(alarm.effect + "@" + alarm.port, effect + "@" + port) << alarm.text;
    EXPECT_TRUE(alarm.active);
    EXPECT_NEAR(alarm.since, since, 2.1);
  }
  EXPECT_EQ(count, 1u);
}

TEST(DataWithGaps, AFaultThatIsThereAfterAGapIsNotAnotherBuild) {
  SimulationSetup setup;
  setup.profile = "steps";
  setup.effects.push_back(parse_effect("orifice_leakage@flow.chamber_a_chamber_b:coefficient=2e-8,from=15"));
  const Recording r = simulate(servo(), setup, 27);
  for (const double lost : {15.5, 17.85, 22.0})
    for (const double gap : {0.13, 1.5}) {
      SCOPED_TRACE(std::to_string(lost) + " s, for " + std::to_string(gap) + " s");
      expect_one(diagnosed_without(servo(), r, lost, gap), "orifice_leakage", "flow.chamber_a_chamber_b", 16);
    }
}

TEST(DataWithGaps, WhatALeakHasBecomeBeforeAGapIsNotTheRigInGoodOrder) {
  const Datasheet cooling = find_datasheet(config_folder(), "cooling_circuit");
  SimulationSetup setup;
  setup.effects.push_back(parse_effect("orifice_leakage@flow.v2_inlet_ambient:coefficient=2e-8,from=20,to=25"));
  const Recording r = simulate(cooling, setup, 40);
  for (const double lost : {21.0, 24.0, 30.0})
    for (const double gap : {0.15, 3.0}) {
      SCOPED_TRACE(std::to_string(lost) + " s, for " + std::to_string(gap) + " s");
      expect_one(diagnosed_without(cooling, r, lost, gap), "orifice_leakage", "flow.v2_inlet_ambient",
                 lost < 23 ? lost + gap : 22);
    }
}

TEST(DataWithGaps, OfARigInGoodOrderRaiseNothingElse) {
  const auto expect_silence = [](const Datasheet& sheet, const std::string& profile, std::uint64_t seed) {
    SCOPED_TRACE(sheet.rig);
    SimulationSetup setup;
    setup.profile = profile;
    setup.seed = seed;
    const Recording r = simulate(sheet, setup, 40);
    Diagnosis diagnosis(sheet);
    for (std::size_t k = 0; k < r.rows(); ++k) {
      const double t = r.time[k];
      const bool lost = (t > 12 && t < 12.5) || (t > 20 && t < 23) || (t > 28 && t < 28.15);
      if (!lost) diagnosis.process(r.sample(k));
    }
    for (const Alarm& alarm : diagnosis.report().alarms) EXPECT_EQ(alarm.level, AlarmLevel::stale) << alarm.text;
  };
  expect_silence(servo(), "random", 4);
  // Its valve is moved while samples are lost.
  expect_silence(find_datasheet(config_folder(), "cooling_circuit"), "valve_steps", 4);
}

// What rests with a fault in it moves as no parameter makes it: friction holds.
TEST(BadData, AFaultFromTheBeginningAtRestIsNotAnotherBuild) {
  SimulationSetup setup;
  setup.profile = "steps";
  setup.effects.push_back(parse_effect("orifice_leakage@flow.chamber_a_chamber_b:coefficient=2e-8,from=15"));
  const Recording r = simulate(servo(), setup, 27);
  for (const double begin : {16.0, 17.0, 19.0}) {
    SCOPED_TRACE(begin);
    const AlarmReport report = diagnosed_without(servo(), r, 0, begin);
    const Verdict verdict = verdict_of(report, begin, 27);
    EXPECT_EQ(verdict.kind, VerdictKind::fault) << verdict.sentence;
    for (const Alarm& alarm : report.alarms) EXPECT_NE(alarm.kind, AlarmKind::data) << alarm.text;
  }
}

TEST(BadData, SamplesThatAreHeldAreOneAlarm) {
  const Told told = diagnosed([](Recording& r, std::size_t k) {
    for (std::size_t c = 0; c < r.columns(); ++c) r.values[k * r.columns() + c] = r.at(k / 10 * 10, c);
  });
  EXPECT_EQ(told.verdict.kind, VerdictKind::data) << told.verdict.sentence;
  EXPECT_NE(told.verdict.sentence.find("repeat their readings"), std::string::npos) << told.verdict.sentence;
  expect_no_fault(told.report);
}

TEST(BadData, ARunTooShortToJudgeIsNotObservable) {
  const Told told = diagnosed([](Recording&, std::size_t) {}, 0.002);
  EXPECT_EQ(told.verdict.kind, VerdictKind::not_observable) << told.verdict.sentence;
  EXPECT_TRUE(told.report.alarms.empty());
  EXPECT_EQ(diagnosed([](Recording&, std::size_t) {}).verdict.kind, VerdictKind::healthy);
}

}  // namespace
}  // namespace faultline
