#include "faultline/signal/row_assembly.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace faultline {
namespace {

constexpr double kPi = 3.14159265358979323846;

struct Row {
  double time;
  std::uint64_t number;
  std::vector<double> values;
};

struct Message {
  std::size_t signal;
  double time, value;
};

AssemblyPlan plan_of(double period, bool resample, std::vector<SignalPlan> signals) {
  AssemblyPlan plan;
  plan.period = period;
  plan.resample = resample;
  plan.signals = std::move(signals);
  while (plan.signals[plan.leader].held) ++plan.leader;
  return plan;
}

std::vector<Row> assemble(const AssemblyPlan& plan, const std::vector<Message>& messages) {
  std::vector<Row> rows;
  RowAssembler assembler(plan, [&](double time, std::uint64_t number, const std::vector<double>& values) {
    rows.push_back({time, number, values});
  });
  for (const Message& message : messages) assembler.push(message.signal, message.time, message.value);
  assembler.finish();
  return rows;
}

void expect_same(const std::vector<Row>& a, const std::vector<Row>& b, std::size_t count) {
  ASSERT_GE(a.size(), count);
  ASSERT_GE(b.size(), count);
  for (std::size_t i = 0; i < count; ++i) {
    EXPECT_EQ(a[i].time, b[i].time) << i;
    EXPECT_EQ(a[i].number, b[i].number) << i;
    for (std::size_t s = 0; s < a[i].values.size(); ++s)
      EXPECT_TRUE(a[i].values[s] == b[i].values[s] || (std::isnan(a[i].values[s]) && std::isnan(b[i].values[s])))
          << i << " " << s << ": " << a[i].values[s] << " " << b[i].values[s];
  }
}

constexpr SignalPlan kMeasured{};
constexpr SignalPlan kHeld{true};

TEST(RowAssembly, EqualStampsMakeRowsAsTheyAre) {
  std::vector<Message> messages;
  for (int k = 0; k < 50; ++k)
    for (std::size_t s = 0; s < 3; ++s) messages.push_back({s, 7 + 0.1 * k, k + 0.25 * static_cast<double>(s)});
  const auto rows = assemble(plan_of(0.1, false, {kHeld, kMeasured, kMeasured}), messages);
  ASSERT_EQ(rows.size(), 50u);
  for (int k = 0; k < 50; ++k) {
    EXPECT_EQ(rows[static_cast<std::size_t>(k)].time, 7 + 0.1 * k);
    EXPECT_EQ(rows[static_cast<std::size_t>(k)].values, (std::vector<double>{1.0 * k, k + 0.25, k + 0.5}));
  }
}

TEST(RowAssembly, MeasuredValuesLieOnALineAndCommandsAreHeld) {
  // The command is 3 ms, the second measured signal 4 ms behind the first.
  std::vector<Message> messages;
  for (int k = 0; k < 40; ++k) {
    const double t = 0.01 * k;
    messages.push_back({0, t, 5 * t});
    messages.push_back({1, t + 0.003, 1.0 * k});
    messages.push_back({2, t + 0.004, 100 * (t + 0.004)});
  }
  for (const bool resample : {false, true}) {
    const auto rows = assemble(plan_of(0.01, resample, {kMeasured, kHeld, kMeasured}), messages);
    ASSERT_GE(rows.size(), 38u);
    for (const Row& row : rows) {
      if (row.time <= 0.39) {
        EXPECT_NEAR(row.values[0], 5 * row.time, 1e-12);
        EXPECT_NEAR(row.values[2], 100 * row.time, 1e-10) << row.time;
      }
      EXPECT_EQ(row.values[1], std::floor((row.time - 0.003) / 0.01 + 1e-9)) << row.time;
    }
  }
}

TEST(RowAssembly, WithoutAGridASignalThatIsFarFromTheRowIsMissing) {
  std::vector<Message> messages;
  for (int k = 0; k < 30; ++k) {
    messages.push_back({0, 0.01 * k, 1});
    if (k % 2 == 0) messages.push_back({1, 0.01 * k, 2});
  }
  const auto rows = assemble(plan_of(0.01, false, {kMeasured, kMeasured}), messages);
  ASSERT_EQ(rows.size(), 29u);
  for (std::size_t k = 0; k < 29; ++k) EXPECT_EQ(std::isnan(rows[k].values[1]), k % 2 == 1) << k;
}

TEST(RowAssembly, LongGapsStayAndShortOnesAreBridged) {
  std::vector<Message> messages;
  for (int k = 0; k < 100; ++k) {
    const double t = 0.01 * k;
    const bool both_gone = k > 60 && k < 70;
    if (k != 20 && k != 21 && k != 40 && !both_gone) messages.push_back({0, t, t});
    if (!both_gone) messages.push_back({1, t, -t});
  }
  const auto rows = assemble(plan_of(0.01, true, {kMeasured, kMeasured}), messages);
  std::vector<std::uint64_t> numbers;
  for (const Row& row : rows) {
    numbers.push_back(row.number);
    EXPECT_EQ(std::isnan(row.values[0]), row.number == 20 || row.number == 21) << row.number;
    if (!std::isnan(row.values[0])) {
      EXPECT_NEAR(row.values[0], row.time, 1e-12);
    }
  }
  EXPECT_EQ(std::count(numbers.begin(), numbers.end(), 40u), 1);
  for (std::uint64_t k = 61; k < 70; ++k) EXPECT_EQ(std::count(numbers.begin(), numbers.end(), k), 0) << k;
  EXPECT_EQ(numbers.back(), 99u);
}

// Amplitude of the motion at `frequency` [Hz] in signal 0 of the rows, by projection.
double amplitude(const std::vector<Row>& rows, double frequency, double& phase) {
  double c = 0, s = 0;
  for (const Row& row : rows) {
    c += row.values[0] * std::cos(2 * kPi * frequency * row.time);
    s += row.values[0] * std::sin(2 * kPi * frequency * row.time);
  }
  phase = std::atan2(c, s);
  return 2 * std::hypot(c, s) / static_cast<double>(rows.size());
}

std::vector<Message> tone(double frequency, double period, double duration, double jitter) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> shift(-jitter * period, jitter * period);
  std::vector<Message> messages;
  for (int k = 0; k * period < duration; ++k) {
    const double t = k * period + (jitter > 0 ? shift(random) : 0);
    messages.push_back({0, t, std::sin(2 * kPi * frequency * t)});
  }
  return messages;
}

TEST(RowAssembly, AToneThatWouldFoldIsTakenOut) {
  // 1 kHz to 100 Hz. Sampled as it is, 97 Hz would be seen as 3 Hz, 53 Hz as 47 Hz, 206 Hz as 6 Hz.
  const AssemblyPlan plan = plan_of(0.01, true, {kMeasured});
  for (const double frequency : {53.0, 97.0, 206.0, 447.0}) {
    const auto rows = assemble(plan, tone(frequency, 0.001, 12, 0));
    ASSERT_GT(rows.size(), 1000u);
    double worst = 0, seen = 0;
    for (const Row& row : rows) {
      worst = std::max(worst, std::abs(row.values[0]));
      const double tone_there = std::sin(2 * kPi * frequency * row.time);
      seen = std::max(seen, std::abs(tone_there));
    }
    EXPECT_LT(worst, 2.5e-3) << frequency;  // 52 dB
    EXPECT_GT(seen, 0.9) << frequency;      // what plain sampling would have kept
  }
}

TEST(RowAssembly, TheFilterLeavesThePassBandWhereItIs) {
  const AssemblyPlan plan = plan_of(0.01, true, {kMeasured});
  for (const double jitter : {0.0, 0.2})
    for (const double frequency : {1.0, 10.0, 28.0}) {
      const auto rows = assemble(plan, tone(frequency, 0.001, 12, jitter));
      double phase = 0;
      const std::vector<Row> whole(rows.begin(), rows.begin() + 1000);
      EXPECT_NEAR(amplitude(whole, frequency, phase), 1, 0.01) << frequency << " " << jitter;
      EXPECT_NEAR(phase, 0, 0.01) << frequency << " " << jitter;
    }
}

TEST(RowAssembly, OnlyFasterSignalsAreFiltered) {
  std::vector<Message> messages;
  const std::vector<Message> fast = tone(1, 0.0025, 2, 0.1), same = tone(1, 0.01, 2, 0.1), slow = tone(1, 0.05, 2, 0);
  for (const Message& m : fast) messages.push_back({0, m.time, 3});
  for (const Message& m : same) messages.push_back({1, m.time, m.value});
  for (const Message& m : slow) messages.push_back({2, m.time, m.value});
  RowAssembler assembler(plan_of(0.01, true, {kMeasured, kMeasured, kMeasured}),
                         [](double time, std::uint64_t, const std::vector<double>& values) {
                           if (time > 0.08 && time < 1.9) {
                             EXPECT_NEAR(values[0], 3, 1e-12);  // constants pass
                             EXPECT_NEAR(values[2], std::sin(2 * kPi * time), 0.015);
                           }
                         });
  for (const Message& m : messages) assembler.push(m.signal, m.time, m.value);
  assembler.finish();
  EXPECT_TRUE(assembler.filtered(0));
  EXPECT_FALSE(assembler.filtered(1));
  EXPECT_FALSE(assembler.filtered(2));
  EXPECT_NEAR(assembler.own_period(2), 0.05, 1e-9);
}

TEST(RowAssembly, ACommandThatStopsCountsForAWhileOnlyUnlessItIsSentOnChange) {
  std::vector<Message> messages;
  for (int k = 0; k <= 200; ++k) {
    if (k % 10 == 0 && k < 100) messages.push_back({0, 0.01 * k, 2});
    messages.push_back({1, 0.01 * k, 1});
  }
  const auto last_command = [&](const SignalPlan& command) {
    double last = 0;
    for (const Row& row : assemble(plan_of(0.01, true, {command, kMeasured}), messages))
      if (row.values[0] == 2) last = row.time;
    return last;
  };
  // Every 0.1 s, the last at 0.9 s: 2.5 intervals later it is no command any more.
  EXPECT_NEAR(last_command({true}), 1.15, 0.011);
  EXPECT_NEAR(last_command({true, 0.5}), 1.4, 0.011);
  EXPECT_NEAR(last_command({true, std::numeric_limits<double>::infinity()}), 2, 0.011);
}

// Signals of a stand: two fast, one slow, a command on change; each on its way for a time of its own.
std::vector<Message> stand(double lag, std::vector<Message>& arrived) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> jitter(-0.001, 0.001), way(0, lag);
  std::vector<Message> messages;
  for (int k = 0; k < 4000; ++k) messages.push_back({0, 0.001 * k, std::sin(0.01 * k)});
  for (int k = 0; k < 400; ++k) messages.push_back({1, 0.01 * k + jitter(random) + 0.002, std::cos(0.1 * k)});
  for (int k = 0; k < 80; ++k) messages.push_back({2, 0.05 * k + 0.001, 1.0 * k});
  for (const int k : {0, 700, 1500, 1503, 2777}) messages.push_back({3, 0.001 * k + 0.0004, 0.5 * k});
  std::stable_sort(messages.begin(), messages.end(), [](const auto& a, const auto& b) { return a.time < b.time; });
  std::vector<std::pair<double, std::size_t>> order;
  double last[4] = {-1, -1, -1, -1};
  for (std::size_t i = 0; i < messages.size(); ++i) {
    double& before = last[messages[i].signal];  // one topic keeps its order
    before = std::max(before, messages[i].time + way(random));
    order.emplace_back(before, i);
  }
  std::sort(order.begin(), order.end());
  for (const auto& entry : order) arrived.push_back(messages[entry.second]);
  return messages;
}

TEST(RowAssembly, LiveRowsAreThoseOfARecordingWhateverTheInterleaving) {
  std::vector<Message> arrived;
  const std::vector<Message> recorded = stand(0.06, arrived);
  AssemblyPlan plan = plan_of(0.01, true, {kMeasured, kMeasured, kMeasured, {true, 1e9}});
  const auto offline = assemble(plan, recorded);
  plan.wait = 0.1;
  const auto live = assemble(plan, arrived);
  ASSERT_GT(offline.size(), 350u);
  ASSERT_EQ(live.size(), offline.size());
  expect_same(live, offline, offline.size());
}

TEST(RowAssembly, LiveRowsComeSoonAndASilentSignalHoldsNothingUp) {
  AssemblyPlan plan = plan_of(0.01, true, {kMeasured, kMeasured});
  plan.wait = 0.1;
  std::vector<Row> rows;
  RowAssembler assembler(plan, [&](double time, std::uint64_t number, const std::vector<double>& values) {
    rows.push_back({time, number, values});
  });
  for (int k = 0; k < 300; ++k) {
    const double t = 0.01 * k;
    assembler.push(0, t, 1);
    if (k < 100) assembler.push(1, t, 2);
    if (k > 20 && k < 100) {
      EXPECT_NEAR(rows.back().time, t, 0.0101);
    }
    if (k > 115) {
      EXPECT_NEAR(rows.back().time, t, 0.0101);
      EXPECT_TRUE(std::isnan(rows.back().values[1]));
      EXPECT_TRUE(assembler.silent(1));
    }
  }
  EXPECT_FALSE(assembler.silent(0));
}

TEST(RowAssembly, WhatComesLateOrTwiceIsSaid) {
  AssemblyPlan plan = plan_of(0.01, true, {kMeasured, kHeld});
  plan.wait = 0.05;
  RowAssembler assembler(plan, [](double, std::uint64_t, const std::vector<double>&) {});
  using Taken = RowAssembler::Taken;
  assembler.push(1, 0, 1);
  for (int k = 0; k < 100; ++k) EXPECT_EQ(assembler.push(0, 0.01 * k, 1), Taken::yes);
  EXPECT_EQ(assembler.push(0, 0.99, 1), Taken::backward);
  EXPECT_EQ(assembler.push(0, 0.5, 1), Taken::backward);
  EXPECT_EQ(assembler.push(1, 0.5, 1), Taken::late);
  EXPECT_EQ(assembler.push(1, 0.985, 1), Taken::yes);
  assembler.restart();
  EXPECT_EQ(assembler.push(0, 0.5, 1), Taken::yes);
}

TEST(RowAssembly, OnceNothingIsOnItsWayACommandIsWaitedForNoLonger) {
  AssemblyPlan plan = plan_of(0.01, false, {kMeasured, kHeld});
  plan.wait = 10;
  std::size_t rows = 0;
  RowAssembler assembler(plan, [&](double, std::uint64_t, const std::vector<double>&) { ++rows; });
  assembler.push(1, 0, 1);
  for (int k = 0; k < 10; ++k) assembler.push(0, 0.01 * k, 1);
  EXPECT_EQ(rows, 1u);
  assembler.settle();
  EXPECT_EQ(rows, 10u);
}

}  // namespace
}  // namespace faultline
