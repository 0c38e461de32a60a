// The life cycle of an alarm by numbers: which size is left when it ends.
#include "faultline/alarms/alarm_book.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "faultline/alarms/diagnosis.h"

namespace faultline {
namespace {

Finding sized(double size, double low, double high, double confidence, double none = 0) {
  Finding f;
  f.active = true;
  f.kind = AlarmKind::fault;
  f.effect = "orifice_leakage";
  f.port = "flow.a_b";
  f.size_name = "coefficient";
  f.text = "leak";
  f.has_size = true;
  f.size = size;
  f.low = low;
  f.high = high;
  f.confidence = confidence;
  f.none = none;
  return f;
}

const Alarm& after(AlarmBook& book, const std::vector<Finding>& findings) {
  int alarm = -1;
  double time = 0;
  for (const Finding& f : findings) book.tell(alarm, f, time++);
  book.end(alarm, time);
  EXPECT_EQ(alarm, -1);
  return book.report.alarms.back();
}

TEST(ToldSize, HasTheDigitsThatTellItsBoundsApart) {
  Alarm alarm;
  EXPECT_EQ(told_size(alarm), "");
  alarm.has_size = true;
  alarm.size_unit = "1";
  alarm.size = 1.0123, alarm.low = 1.0101, alarm.high = 1.0145;
  EXPECT_EQ(told_size(alarm), "1.012 (90 %: 1.01 to 1.014)");
  alarm.size_unit = "bar";
  alarm.size = 20, alarm.low = 15.5, alarm.high = 24.51;
  EXPECT_EQ(told_size(alarm), "20 bar (90 %: 15.5 to 24.5)");
  alarm.low = 20 - 1e-9, alarm.high = 20 + 1e-9;  // no more than six
  EXPECT_EQ(told_size(alarm), "20 bar (90 %: 20 to 20)");
  alarm.low = alarm.high = 20;
  EXPECT_EQ(told_size(alarm), "20 bar");
}

TEST(Verdict, SaysSinceWhenAFaultThatComesAndGoesWasThereFirst) {
  AlarmReport report;
  const auto add = [&](const char* port, double since, double until) {
    Alarm alarm;
    alarm.kind = AlarmKind::fault;
    alarm.effect = "clogging";
    alarm.port = port;
    alarm.text = "clogged";
    alarm.since = alarm.raised = since;
    alarm.until = until;
    alarm.active = until == 60;
    report.alarms.push_back(alarm);
  };
  add("restriction.other", 5, 8);
  add("restriction.valve", 43, 60);
  EXPECT_EQ(verdict_of(report, 0, 60).sentence, "clogged, since 43.0 s, still there at the end; 1 more alarm.");
  add("restriction.valve", 31, 35);
  add("restriction.valve", 17, 19);
  EXPECT_EQ(
      verdict_of(report, 0, 60).sentence,
      "clogged, since 43.0 s, still there at the end; the same 2 times before, first since 17.0 s; 1 more alarm.");
}

TEST(AlarmBook, TheMostCertainSizeIsLeft) {
  AlarmBook book(10);
  const Alarm& leak =
      after(book, {sized(5, 1, 9, 0.6), sized(10, 9, 11, 0.9), sized(4, 2, 6, 0.8), sized(0.1, -2, 2.2, 0.5)});
  EXPECT_EQ(leak.size, 10);
  EXPECT_EQ(leak.low, 9);
  EXPECT_EQ(leak.high, 11);
  EXPECT_EQ(leak.confidence, 0.9);
  EXPECT_FALSE(leak.active);
}

TEST(AlarmBook, DistanceCountsFromTheSizeThatIsNoEffect) {
  AlarmBook book(10);
  // A scale of 1.3 fades to 1, the narrower the interval, the less is left of it.
  EXPECT_EQ(after(book, {sized(1.3, 1.25, 1.35, 0.9, 1), sized(1.01, 0.99, 1.03, 0.9, 1)}).size, 1.3);
  // A stiffness, of which infinite is none.
  const double infinite = std::numeric_limits<double>::infinity();
  EXPECT_EQ(after(book, {sized(100, 90, 112, 0.9, infinite), sized(9000, 4500, infinite, 0.9, infinite)}).size, 100);
}

// Since when it is wrong belongs to the cause; one that began later than the alarm was raised is another alarm.
TEST(AlarmBook, AnotherCauseHasABeginningOfItsOwn) {
  AlarmBook book(10);
  int alarm = -1;
  Finding offset = sized(1, 0, 2, 0.9), leak = sized(5, 4, 6, 0.9), friction = sized(7, 6, 8, 0.9);
  offset.effect = "offset";
  offset.since = 1;
  leak.since = 3;
  friction.effect = "coulomb_friction";
  friction.since = 8;
  friction.equivalent = {"orifice_leakage@flow.a_b"};
  book.tell(alarm, offset, 4);
  book.tell(alarm, leak, 6);
  ASSERT_EQ(book.report.alarms.size(), 1u);
  EXPECT_EQ(book.report.alarms[0].since, 3);
  book.tell(alarm, friction, 9);  // the same among others
  ASSERT_EQ(book.report.alarms.size(), 1u);
  EXPECT_EQ(book.report.alarms[0].since, 3);
  offset.since = 10;
  book.tell(alarm, offset, 12);
  ASSERT_EQ(book.report.alarms.size(), 2u);
  EXPECT_FALSE(book.report.alarms[0].active);
  EXPECT_EQ(book.report.alarms[0].effect, "coulomb_friction");
  EXPECT_EQ(book.report.alarms[0].until, 12);
  EXPECT_TRUE(book.report.alarms[1].active);
  EXPECT_EQ(book.report.alarms[1].since, 10);
  EXPECT_EQ(book.report.alarms[1].raised, 12);
}

TEST(AlarmBook, WithoutAnIntervalTheConfidenceDecidesThenTheLatest) {
  AlarmBook book(10);
  EXPECT_EQ(after(book, {sized(2, 2, 2, 0.5), sized(7, 7, 7, 0.9), sized(3, 3, 3, 0.6)}).size, 7);
  EXPECT_EQ(after(book, {sized(2, 2, 2, 1), sized(7, 7, 7, 1), sized(3, 3, 3, 1)}).size, 3);
  EXPECT_EQ(after(book, {sized(2, 2, 2, 1), sized(7, 6, 8, 0.5), sized(3, 3, 3, 1)}).size, 7);  // bounds say more
}

TEST(AlarmBook, AnotherNameForgetsTheSizeOfTheFirst) {
  AlarmBook book(10);
  Finding drift = sized(5, 4, 6, 0.9);
  drift.effect = "drift";
  drift.size_name = "rate";
  EXPECT_EQ(after(book, {sized(1000, 990, 1010, 0.9), drift}).size, 5);
}

TEST(AlarmBook, OnlyTheLatestIsTakenBack) {
  AlarmBook book(10);
  int a = book.raise(AlarmKind::data, "", "", AlarmLevel::stale, 1, 1, "a");
  int b = book.raise(AlarmKind::fault, "", "", AlarmLevel::error, 2, 2, "b");
  EXPECT_FALSE(book.take_back(a));
  EXPECT_EQ(a, 0);
  EXPECT_TRUE(book.take_back(b));
  EXPECT_EQ(b, -1);
  EXPECT_TRUE(book.take_back(a));
  EXPECT_TRUE(book.report.alarms.empty());
  EXPECT_FALSE(book.take_back(a));
}

TEST(AlarmBook, AnEndedAlarmGivesItsPlaceNeverAnActiveOne) {
  AlarmBook book(2);
  int a = book.raise(AlarmKind::data, "", "", AlarmLevel::error, 1, 1, "a");
  int b = book.raise(AlarmKind::data, "", "", AlarmLevel::error, 2, 2, "b");
  book.end(a, 3);
  const int c = book.raise(AlarmKind::data, "", "", AlarmLevel::error, 4, 4, "c");
  EXPECT_EQ(c, 0);
  EXPECT_EQ(book.at(b).text, "b");
  const int d = book.raise(AlarmKind::data, "", "", AlarmLevel::error, 5, 5, "d");
  EXPECT_EQ(d, 2);  // more than asked for rather than an active one lost
  EXPECT_EQ(book.report.alarms.size(), 3u);
}

}  // namespace
}  // namespace faultline
