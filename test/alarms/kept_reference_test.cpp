// A fault that is there from the start, on the cooling circuit: learnt as normal, unless the rig's detectors and
// isolators judge by what they learnt on a healthy firing before.
#include <gtest/gtest.h>

#include <fmt/format.h>

#include "faultline/alarms/diagnosis.h"
#include "faultline/signal/error.h"
#include "rigs/cooling_circuit/recordings.h"

namespace faultline {
namespace {

constexpr double kLeak = 2e-8;  // m^3/(s sqrt(Pa)), 2 % of the channel's own coefficient

// The same rig each time, its noise another.
Recording firing(std::uint64_t seed, const std::string& effect = "") {
  SimulationSetup setup = cooling_recording("steady", 341, effect);
  setup.seed = seed;
  return simulate(cooling(), setup, 8);
}

void run(Diagnosis& diagnosis, const Recording& recording) {
  for (std::size_t k = 0; k < recording.rows(); ++k) diagnosis.process(recording.sample(k));
}

const References& learnt() {
  static const References references = [] {
    Diagnosis diagnosis(cooling());
    run(diagnosis, firing(1));
    EXPECT_TRUE(diagnosis.report().alarms.empty());
    return parse_references(to_text(diagnosis.references()), "cooling_circuit", "a test");  // as a file holds them
  }();
  return references;
}

std::string leak() { return fmt::format("orifice_leakage@flow.v2_outlet_ambient:coefficient={:g}", kLeak); }

TEST(KeptReference, HoldsTheIsolatorAndEveryRedline) {
  EXPECT_EQ(learnt().stages.size(), 27u);  // 26 redlines: supply, and 5 of each of 5 branches
  EXPECT_EQ(learnt().stages.back().stage, "branch_faults");
  EXPECT_EQ(learnt().stages.back().reference.type, "signatures");
}

TEST(KeptReference, WithoutItALeakFromIgnitionOnIsNormal) {
  Diagnosis diagnosis(cooling());
  run(diagnosis, firing(2, leak()));
  for (const Alarm& alarm : diagnosis.report().alarms) EXPECT_NE(alarm.kind, AlarmKind::fault) << alarm.text;
}

TEST(KeptReference, WithItALeakFromIgnitionOnIsNamedAndSizedAtOnce) {
  Diagnosis diagnosis(cooling());
  diagnosis.restore(learnt());
  run(diagnosis, firing(2, leak()));
  const Verdict verdict = verdict_of(diagnosis.report(), 0, 8);
  EXPECT_EQ(verdict.kind, VerdictKind::fault) << verdict.sentence;
  const Alarm* alarm = headline(diagnosis.report());
  ASSERT_NE(alarm, nullptr);
  EXPECT_EQ(alarm->effect, "orifice_leakage") << verdict.sentence;
  EXPECT_EQ(alarm->port, "flow.v2_outlet_ambient") << verdict.sentence;
  EXPECT_NEAR(alarm->size, kLeak, 0.1 * kLeak);
  EXPECT_LE(alarm->low, kLeak);
  EXPECT_GE(alarm->high, kLeak);
  // The isolator arms some 3 s after the start, when the firing is steady; the second that learning takes is not waited
  // for.
  EXPECT_LT(alarm->raised, 3.5);
  EXPECT_TRUE(alarm->active);
}

TEST(KeptReference, WithItAHealthyFiringStaysSilent) {
  for (const std::uint64_t seed : {3, 4}) {
    Diagnosis diagnosis(cooling());
    diagnosis.restore(learnt());
    run(diagnosis, firing(seed));
    EXPECT_TRUE(diagnosis.report().alarms.empty()) << diagnosis.report().alarms[0].text;
    // What was restored is what would be kept again.
    EXPECT_EQ(to_text(diagnosis.references()), to_text(learnt()));
  }
}

TEST(KeptReference, ItOutlivesAJumpBackInTime) {
  Diagnosis diagnosis(cooling());
  diagnosis.restore(learnt());
  run(diagnosis, firing(3));
  run(diagnosis, firing(2, leak()));
  EXPECT_EQ(verdict_of(diagnosis.report(), 0, 8).kind, VerdictKind::fault);
}

TEST(KeptReference, WhatFitsNoStageIsRefusedByName) {
  const auto refusal = [](const References& references) -> std::string {
    try {
      Diagnosis(cooling()).restore(references);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  References changed = learnt();
  changed.stages.back().stage = "branch_fault";
  EXPECT_EQ(refusal(changed),
            "a test: branch_fault: the rig cooling_circuit has no such detector or isolator; learn it anew");
  changed = learnt();
  changed.stages.back().reference.version = 2;
  EXPECT_EQ(refusal(changed),
            "a test: branch_faults: the reference is of version 2, this program reads version 1; learn it anew");
  changed = learnt();
  changed.stages[0].reference.names[0] = "colour";
  EXPECT_NE(refusal(changed).find("the reference holds colour, this stage needs supply_pressure"), std::string::npos);
  changed = learnt();
  changed.stages[0].stage = "frozen_supply_pressure";
  EXPECT_NE(refusal(changed).find("keeps no reference"), std::string::npos);
}

}  // namespace
}  // namespace faultline
