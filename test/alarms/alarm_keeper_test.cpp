// From assessments to alarms: when a cause is told by its name, and what is told until then.
#include "faultline/alarms/alarm_keeper.h"

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "detectors/estimates.h"
#include "faultline/alarms/diagnosis.h"
#include "faultline/isolation/isolation_stage.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

// Nobody says anything.
Assessment silent() {
  Assessment a;
  a.detectors.resize(servo().detectors.size());
  a.isolators.resize(servo().isolators.size());
  a.channel_status.assign(servo().channels.size(), ChannelStatus::good);
  return a;
}

class Naming : public ::testing::Test {
 protected:
  // The first isolator finds this at the next sample.
  const Alarm& find(const std::string& effect, double confidence) {
    Finding& f = assessment_.isolators[0].finding;
    f.active = true;
    f.kind = AlarmKind::fault;
    f.effect = effect;
    f.port = "flow.chamber_a_tank";
    f.equivalent = {"deadband@restriction.valve"};
    f.text = "Chamber A: " + effect;
    f.has_size = true;
    f.size = 3;
    f.confidence = confidence;
    assessment_.isolators[0].reason = Reason::told;
    assessment_.time += 1e-3;
    keeper_.process(assessment_);
    return keeper_.report().alarms.back();
  }

  Assessment assessment_ = silent();
  AlarmKeeper keeper_{servo()};
};

// A table knows a few causes; what an isolator that weighed more cannot tell from the one it names is told with it.
TEST_F(Naming, WhatStandsUnderAnAlarmAddsWhatItCannotTellFromIt) {
  const std::string table = "orifice_leakage", text = "Chamber A: orifice_leakage";
  const Alarm& alone = find(table, 0.9);
  EXPECT_EQ(alone.equivalent, std::vector<std::string>{"deadband@restriction.valve"});
  IsolatorResult& other = assessment_.isolators[1];
  other.reason = Reason::told_by_another;
  other.finding.active = true;
  other.finding.effect = "laminar_leakage";
  other.finding.port = "flow.chamber_a_tank";
  other.finding.equivalent = {"deadband@restriction.valve", "orifice_leakage@flow.chamber_a_tank",
                              "clogging@restriction.valve"};
  for (int again = 0; again < 2; ++again) {
    const Alarm& beside = find(table, 0.9);
    EXPECT_EQ(beside.effect, table);
    EXPECT_EQ(beside.size, 3);
    EXPECT_EQ(beside.text, text +
                               "; this motion cannot tell it from laminar_leakage@flow.chamber_a_tank, "
                               "clogging@restriction.valve");
    EXPECT_EQ(beside.equivalent,
              (std::vector<std::string>{"deadband@restriction.valve", "laminar_leakage@flow.chamber_a_tank",
                                        "clogging@restriction.valve"}));
  }
  other.finding.effect = "coulomb_friction";  // another cause has nothing to do with it
  other.finding.equivalent.clear();
  EXPECT_EQ(find(table, 0.9).text, text);
  EXPECT_EQ(keeper_.report().alarms.size(), 1u);
}

TEST_F(Naming, WhatIsSeenButLessThanIsToldIsSaidWhereNothingIsWrong) {
  assessment_.judged = true;
  assessment_.isolators[0].finding.too_small = "backlash@transmission.plate, 0.0001 m";
  assessment_.isolators[0].reason = Reason::absent;
  keeper_.process(assessment_);
  EXPECT_EQ(verdict_of(keeper_.report(), 0, 60).sentence,
            "No fault found in 60.0 s; seen, but less than is told: backlash@transmission.plate, 0.0001 m.");
  assessment_.isolators[0].finding.too_small.clear();
  assessment_.time += 1e-3;
  keeper_.process(assessment_);
  EXPECT_EQ(verdict_of(keeper_.report(), 0, 60).sentence, "No fault found in 60.0 s.");
}

TEST_F(Naming, ACauseIsNamedWhenItIsLikelyEnough) {
  const Alarm& first = find("orifice_leakage", 0.44);
  EXPECT_EQ(first.kind, AlarmKind::unknown);
  EXPECT_EQ(first.level, AlarmLevel::warning);
  EXPECT_EQ(first.effect + first.port, "");
  EXPECT_FALSE(first.has_size);
  EXPECT_EQ(first.equivalent,
            (std::vector<std::string>{"orifice_leakage@flow.chamber_a_tank", "deadband@restriction.valve"}));
  EXPECT_EQ(keeper_.report().verdict,
            "Something changed; candidates: orifice_leakage@flow.chamber_a_tank, deadband@restriction.valve.");
  const std::uint64_t changes = keeper_.changes();
  const Alarm& named = find("orifice_leakage", 0.45);
  EXPECT_EQ(keeper_.changes(), changes + 1);
  EXPECT_EQ(keeper_.report().alarms.size(), 1u);
  EXPECT_EQ(named.kind, AlarmKind::fault);
  EXPECT_EQ(named.level, AlarmLevel::error);
  EXPECT_EQ(named.effect, "orifice_leakage");
  EXPECT_EQ(named.equivalent, std::vector<std::string>{"deadband@restriction.valve"});
  EXPECT_EQ(named.size, 3);
  EXPECT_DOUBLE_EQ(named.raised, 1e-3);
}

TEST_F(Naming, ANameIsKeptWhileItIsNotMuchLessLikely) {
  find("orifice_leakage", 0.6);
  EXPECT_EQ(find("orifice_leakage", 0.41).kind, AlarmKind::fault);
  EXPECT_EQ(find("laminar_leakage", 0.41).kind, AlarmKind::unknown);  // another one has to earn it
  EXPECT_EQ(find("orifice_leakage", 0.41).kind, AlarmKind::unknown);
  EXPECT_EQ(find("orifice_leakage", 0.6).kind, AlarmKind::fault);
  EXPECT_EQ(find("orifice_leakage", 0.35).kind, AlarmKind::unknown);
  EXPECT_EQ(keeper_.report().alarms.size(), 1u);
}

TEST_F(Naming, WhatADetectorFoundTooIsNamedByIt) {
  assessment_.detectors[0].detection.active = true;
  assessment_.detectors[0].detection.confidence = 0.9;
  assessment_.isolators[0].detector = 0;
  const Finding meaning = meaning_of(servo().detectors[0]);
  const Alarm& alarm = find("deadband", 0.1);
  EXPECT_EQ(alarm.kind, meaning.kind);
  EXPECT_EQ(alarm.effect, meaning.effect);
  EXPECT_EQ(alarm.equivalent.front(), "deadband@flow.chamber_a_tank");
}

TEST_F(Naming, ADetectorTooMustBeSureOfItsName) {
  DetectorResult& result = assessment_.detectors[0];
  result.detection.active = true;
  result.reason = Reason::told;
  const Finding meaning = meaning_of(servo().detectors[0]);
  const auto told = [&](double confidence) {
    result.detection.confidence = confidence;
    assessment_.time += 1e-3;
    keeper_.process(assessment_);
    return keeper_.report().alarms.back();
  };
  const Alarm first = told(0.44);
  EXPECT_EQ(first.kind, AlarmKind::unknown);
  EXPECT_EQ(first.equivalent, std::vector<std::string>{meaning.effect + "@" + meaning.port});
  EXPECT_EQ(told(0.45).effect, meaning.effect);
  EXPECT_EQ(told(0.1).effect, meaning.effect);  // while it fades it keeps the name that it earned
  EXPECT_EQ(keeper_.report().alarms.size(), 1u);
}

TEST_F(Naming, WhatIsNotDecidedIsNotCalledHealthyWithoutAWord) {
  const auto verdicts = [&](double since) {
    assessment_.judged = true;
    assessment_.undecided_since = since;
    assessment_.time += 1e-3;
    keeper_.process(assessment_);
    const AlarmReport& report = keeper_.report();
    return std::make_pair(report.verdict, verdict_of(report, -20, report.time).sentence);
  };
  const auto [nothing, nothing_at_the_end] = verdicts(std::nan(""));
  EXPECT_EQ(nothing, "No fault found.");
  EXPECT_EQ(nothing_at_the_end, "No fault found in 20.0 s.");
  const auto [now, at_the_end] = verdicts(-5);
  EXPECT_EQ(now, "No fault found; something may be wrong for 5 s and is not confirmed.");
  EXPECT_EQ(at_the_end,
            "No fault found in 20.0 s; something may be wrong since 15.0 s, which the recording is too short to "
            "confirm.");
}

TEST_F(Naming, TheDetectorGoesOnWithTheAlarmThatTheIsolatorLeaves) {
  assessment_.detectors[0].detection.active = true;
  assessment_.isolators[0].detector = 0;
  find("deadband", 0.9);
  assessment_.isolators[0] = IsolatorResult();
  assessment_.detectors[0].reason = Reason::told;
  assessment_.detectors[0].takes_over = 0;
  assessment_.time += 1e-3;
  keeper_.process(assessment_);
  ASSERT_EQ(keeper_.report().alarms.size(), 1u);
  EXPECT_TRUE(keeper_.report().alarms[0].active);
  EXPECT_DOUBLE_EQ(keeper_.report().alarms[0].raised, 1e-3);
}

TEST_F(Naming, TheIsolatorGoesOnWithTheAlarmThatTheDetectorLeaves) {
  const Finding meaning = meaning_of(servo().detectors[0]);
  const auto raised_once_left_to = [&](const std::string& effect) {
    keeper_.reset();
    assessment_ = silent();
    assessment_.detectors[0].reason = Reason::told;
    assessment_.detectors[0].detection.confidence = 0.9;
    keeper_.process(assessment_);
    assessment_.detectors[0] = DetectorResult();
    IsolatorResult& found = assessment_.isolators[0];
    found.reason = Reason::told;
    found.finding.confidence = 0.9;
    found.finding.effect = effect;
    found.finding.port = meaning.port;
    assessment_.time += 1e-3;
    keeper_.process(assessment_);
    return keeper_.report().alarms;
  };
  const std::vector<Alarm> same = raised_once_left_to(meaning.effect);
  ASSERT_EQ(same.size(), 1u);
  EXPECT_TRUE(same[0].active);
  EXPECT_EQ(same[0].effect, meaning.effect);
  const std::vector<Alarm> another = raised_once_left_to("deadband");
  ASSERT_EQ(another.size(), 2u);
  EXPECT_FALSE(another[0].active);
}

// Samples come all the time and the diagnosis pauses, or the other way round.
class Silence : public ::testing::Test {
 protected:
  void hear(double from, double to) {
    for (double time = from; time < to + 0.5e-3; time += 1e-3) keeper_.heard(time);
  }
  void judge(double time) {
    assessment_.time = time;
    keeper_.process(assessment_);
  }
  std::vector<std::pair<double, double>> silences() const {
    std::vector<std::pair<double, double>> found;
    for (const Alarm& alarm : keeper_.report().alarms)
      if (alarm.level == AlarmLevel::stale) found.emplace_back(alarm.since, alarm.until);
    return found;
  }

  Assessment assessment_ = silent();
  AlarmKeeper keeper_{servo()};
};

TEST_F(Silence, APauseOfTheDiagnosisIsNone) {
  hear(10, 15);
  judge(10);
  judge(14);
  EXPECT_TRUE(silences().empty());
  hear(15.001, 16);
  judge(16);
  EXPECT_TRUE(silences().empty());
}

TEST_F(Silence, OneOfTheRigWhileTheDiagnosisPausesIsTold) {
  hear(10, 11);
  judge(10);
  hear(12, 15);
  judge(14);
  ASSERT_EQ(silences().size(), 1u);
  EXPECT_NEAR(silences()[0].first, 11.1, 1e-9);
  EXPECT_DOUBLE_EQ(silences()[0].second, 12);
  EXPECT_EQ(keeper_.report().verdict, "No fault now; there were alarms before.");
}

TEST_F(Silence, OneThatWasToldEndsWithTheFirstSampleNotWithTheFirstJudgement) {
  hear(10, 11);
  judge(11);
  keeper_.advance(12);
  ASSERT_EQ(silences().size(), 1u);
  hear(12, 15);
  judge(14.5);
  ASSERT_EQ(silences().size(), 1u);
  EXPECT_DOUBLE_EQ(silences()[0].second, 12);
}

TEST_F(Silence, OneThatSamplesOnTheirWayDisproveIsTakenBack) {
  hear(10, 11);
  judge(11);
  keeper_.advance(12);
  ASSERT_EQ(silences().size(), 1u);
  hear(11.001, 12);
  judge(11.5);
  EXPECT_TRUE(silences().empty());
}

TEST_F(Silence, IsDatedFromTheLastSampleThatWasHeardWhoseJudgementComesLater) {
  hear(10, 11);
  keeper_.heard(11);  // to the last digit
  judge(10.9);
  keeper_.advance(12);
  const std::uint64_t changes = keeper_.changes();
  for (const double time : {10.95, 11.0}) {
    judge(time);
    ASSERT_EQ(silences().size(), 1u);
    EXPECT_NEAR(silences()[0].first, 11.1, 1e-9);
    EXPECT_TRUE(keeper_.report().alarms[0].active);
  }
  EXPECT_EQ(keeper_.changes(), changes);
  hear(12, 12);
  judge(12);
  ASSERT_EQ(silences().size(), 1u);
  EXPECT_DOUBLE_EQ(silences()[0].second, 12);
  EXPECT_FALSE(keeper_.report().alarms[0].active);
}

TEST_F(Silence, AJudgementOfASampleThatWasNotHeardHereCounts) {
  hear(10, 11);
  judge(11.001);
  keeper_.advance(12);
  ASSERT_EQ(silences().size(), 1u);
  EXPECT_NEAR(silences()[0].first, 11.101, 1e-9);
}

TEST_F(Silence, IsToldWhereNothingWasEverJudged) {
  keeper_.advance(12);
  EXPECT_TRUE(silences().empty());
  hear(10, 11);
  keeper_.advance(12);
  ASSERT_EQ(silences().size(), 1u);
  EXPECT_NEAR(silences()[0].first, 11.1, 1e-9);
}

TEST_F(Silence, AfterStampsOfZeroIsTold) {
  hear(10, 11);
  judge(11);
  for (int i = 0; i < 10; ++i) keeper_.heard(0);
  keeper_.advance(1);
  ASSERT_EQ(silences().size(), 1u);
  EXPECT_NEAR(silences()[0].first, 0.1, 1e-9);
  hear(20, 21);
  judge(21);
  for (const Alarm& alarm : keeper_.report().alarms) EXPECT_FALSE(alarm.active) << alarm.text;
}

TEST_F(Silence, IsToldInARunThatBeganAnew) {
  hear(10, 20);
  judge(10);
  judge(20);
  hear(10, 11);
  judge(10);
  judge(11);
  hear(13, 13);
  judge(13);
  ASSERT_EQ(silences().size(), 1u);
  EXPECT_NEAR(silences()[0].first, 11.1, 1e-9);
}

TEST_F(Silence, StampsThatStoodStillTellNone) {
  for (int i = 0; i < 10; ++i) keeper_.heard(0);
  judge(0);
  hear(1.7e9, 1.7e9 + 1);
  judge(1.7e9);
  judge(1.7e9 + 1);
  EXPECT_TRUE(silences().empty());
}

TEST_F(Silence, WithoutWordOfSamplesJudgementsTell) {
  judge(10);
  judge(14);
  ASSERT_EQ(silences().size(), 1u);
  EXPECT_DOUBLE_EQ(silences()[0].second, 14);
}

TEST_F(Naming, AnAssessmentOfAnotherRigIsRefused) {
  assessment_.detectors.pop_back();
  EXPECT_THROW(keeper_.process(assessment_), InputError);
  assessment_ = silent();
  assessment_.isolators[0].detector = 99;
  EXPECT_THROW(keeper_.process(assessment_), InputError);
}

}  // namespace
}  // namespace faultline
