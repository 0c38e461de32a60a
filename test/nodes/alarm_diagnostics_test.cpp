#include "nodes/alarm_diagnostics.h"

#include <algorithm>
#include <string>

#include <gtest/gtest.h>

#include "nodes/alarm_history.h"
#include "nodes/conversion.h"

namespace faultline {
namespace {

using diagnostic_msgs::DiagnosticStatus;

Alarm leak(bool active) {
  Alarm alarm;
  alarm.kind = AlarmKind::fault;
  alarm.effect = "orifice_leakage";
  alarm.port = "flow.a_b";
  alarm.level = AlarmLevel::error;
  alarm.active = active;
  alarm.since = 10;
  alarm.raised = 11;
  alarm.until = 20;
  alarm.text = "it leaks";
  return alarm;
}

AlarmReport report(std::vector<Alarm> alarms, double time) {
  AlarmReport made;
  made.judged = true;
  made.rig = "tank";
  made.time = time;
  made.verdict = "said";
  made.alarms = std::move(alarms);
  return made;
}

const DiagnosticStatus* find(const diagnostic_msgs::DiagnosticArray& array, const std::string& name) {
  const auto found = std::find_if(array.status.begin(), array.status.end(),
                                  [&](const DiagnosticStatus& status) { return status.name == name; });
  return found == array.status.end() ? nullptr : &*found;
}

const char* const kLeak = "hall/tank: fault orifice_leakage at flow.a_b";

TEST(AlarmDiagnostics, NamesBeginWithTheRigInThisGraph) {
  const auto array = to_diagnostics(report({leak(true)}, 20), "hall/tank");
  ASSERT_EQ(array.status.size(), 2u);
  EXPECT_EQ(array.status[0].name, "hall/tank: verdict");
  EXPECT_EQ(array.status[0].hardware_id, "tank");
  ASSERT_NE(find(array, kLeak), nullptr);
  EXPECT_EQ(find(array, kLeak)->level, DiagnosticStatus::ERROR);
}

TEST(AlarmDiagnostics, NothingJudgedIsNotOk) {
  AlarmReport made = report({}, 20);
  EXPECT_EQ(to_diagnostics(made, "tank").status[0].level, DiagnosticStatus::OK);
  made.judged = false;
  EXPECT_EQ(to_diagnostics(made, "tank").status[0].level, DiagnosticStatus::STALE);
  made.alarms = {leak(true)};
  EXPECT_EQ(to_diagnostics(made, "tank").status[0].level, DiagnosticStatus::ERROR);
}

TEST(AlarmDiagnostics, AlarmsOfOneTitleDoNotHideEachOther) {
  const auto trouble = [](const std::string& text, double raised, double until, bool active) {
    Alarm alarm;
    alarm.kind = AlarmKind::data;
    alarm.level = AlarmLevel::error;
    alarm.text = text;
    alarm.raised = raised;
    alarm.until = until;
    alarm.active = active;
    return alarm;
  };
  std::vector<Alarm> alarms = {trouble("wrong unit", 1, 20, true), trouble("exchanged", 5, 9, false)};
  auto array = to_diagnostics(report(alarms, 20), "tank");
  EXPECT_EQ(find(array, "tank: data")->message, "wrong unit");
  EXPECT_EQ(find(array, "tank: data (2)")->message, "over: exchanged");
  // The next takes the number that is free, and keeps it when the first ends.
  alarms.push_back(trouble("held", 12, 20, true));
  alarms[0].active = false;
  array = to_diagnostics(report(alarms, 20), "tank");
  EXPECT_EQ(array.status.size(), 3u);
  EXPECT_EQ(find(array, "tank: data")->message, "over: wrong unit");
  EXPECT_EQ(find(array, "tank: data (2)")->message, "held");
  EXPECT_EQ(find(array, "tank: data (2)")->level, DiagnosticStatus::ERROR);
}

TEST(AlarmDiagnostics, ANodeThatEndsClosesAllThatItShowed) {
  ClosedStatuses closed;
  auto array = to_diagnostics(report({leak(true)}, 20), "hall/tank");
  closed.close(array);
  array = closed.all("tank");
  ASSERT_EQ(array.status.size(), 2u);
  for (const DiagnosticStatus& status : array.status) EXPECT_EQ(status.level, DiagnosticStatus::OK) << status.name;
  ASSERT_NE(find(array, kLeak), nullptr);
  EXPECT_EQ(find(array, kLeak)->hardware_id, "tank");
}

TEST(AlarmDiagnostics, WhatIsNoLongerReportedIsClosed) {
  ClosedStatuses closed;
  auto array = to_diagnostics(report({leak(true)}, 20), "hall/tank");
  closed.close(array);
  EXPECT_EQ(array.status.size(), 2u);
  for (int round = 0; round < 3; ++round) {  // as long as somebody may have heard of it
    array = to_diagnostics(report({}, 1), "hall/tank");
    closed.close(array);
    ASSERT_NE(find(array, kLeak), nullptr);
    EXPECT_EQ(find(array, kLeak)->level, DiagnosticStatus::OK);
    EXPECT_EQ(find(array, kLeak)->hardware_id, "tank");
  }
  array = to_diagnostics(report({leak(true)}, 30), "hall/tank");
  closed.close(array);
  EXPECT_EQ(array.status.size(), 2u);
  EXPECT_EQ(find(array, kLeak)->level, DiagnosticStatus::ERROR);
}

std::string bytes_of(const AlarmReport& from) {
  const auto message = to_message(from);
  std::string bytes(ros::serialization::serializationLength(message), '\0');
  ros::serialization::OStream stream(reinterpret_cast<std::uint8_t*>(bytes.data()),
                                     static_cast<std::uint32_t>(bytes.size()));
  ros::serialization::serialize(stream, message);
  return bytes;
}

TEST(AlarmHistory, AlarmsOfBeforeAreOverAndComeFirst) {
  AlarmBefore history("tank", bytes_of(report({leak(true), leak(false)}, 20)));
  const AlarmReport now = history.with(report({leak(true)}, 30));
  ASSERT_EQ(now.alarms.size(), 3u);
  EXPECT_FALSE(now.alarms[0].active);
  EXPECT_EQ(now.alarms[0].until, 20);
  EXPECT_NE(now.alarms[0].text.find("started again"), std::string::npos);
  EXPECT_EQ(now.alarms[1].text, "it leaks");
  EXPECT_TRUE(now.alarms[2].active);
}

TEST(AlarmHistory, AnotherRunOrRigAndDamagedBytesAreForgotten) {
  const std::string kept = bytes_of(report({leak(true)}, 20));
  AlarmBefore jumped("tank", kept);
  EXPECT_EQ(jumped.with(report({}, 0)).alarms.size(), 1u);  // no sample yet
  EXPECT_EQ(jumped.with(report({}, 5)).alarms.size(), 0u);
  EXPECT_EQ(jumped.with(report({}, 25)).alarms.size(), 0u);
  EXPECT_EQ(AlarmBefore("pump", kept).with(report({}, 25)).alarms.size(), 0u);
  for (std::size_t length = 0; length < kept.size(); ++length)
    EXPECT_EQ(AlarmBefore("tank", kept.substr(0, length)).with(report({}, 25)).alarms.size(), 0u) << length;
}

}  // namespace
}  // namespace faultline
