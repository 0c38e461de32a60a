// Every excitation shape: range, period, determinism by seed, starting over, and what it refuses.
#include "faultline/rig/excitation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

struct Case {
  std::string shape;
  std::map<std::string, double> numbers;
  std::map<std::string, std::vector<double>> lists;
  double low, high;  // of all values
  double period;     // s; 0: none
  bool random;
};

const std::vector<Case>& cases() {
  static const std::vector<Case> all = {
      {"constant", {{"value", 0.3}}, {}, 0.3, 0.3, 0, false},
      {"square", {{"low", -1}, {"high", 2}, {"period", 4}}, {}, -1, 2, 4, false},
      {"triangle", {{"amplitude", 0.03}, {"mean", 0.01}, {"period", 2.5}}, {}, -0.02, 0.04, 2.5, false},
      {"sines",
       {{"count", 24}, {"base", 0.06}, {"span", 1.6}, {"amplitude", 0.0095}, {"roll_off", 1.1}},
       {},
       -0.228,
       0.228,
       0,
       true},
      {"multisine",
       {{"count", 24}, {"lowest", 0.11}, {"highest", 4}, {"amplitude", 0.03}},
       {},
       -0.0306,
       0.0306,
       0,
       true},
      {"steps", {{"low", -0.05}, {"high", 0.05}, {"shortest", 0.5}, {"longest", 1.6}}, {}, -0.05, 0.05, 0, true},
      {"prbs", {{"low", 1}, {"high", 2.2}, {"clock", 0.05}, {"longest", 7}}, {}, -2.2, 2.2, 0, true},
      {"cycle", {{"low", -0.04}, {"high", 0.06}, {"move", 0.8}, {"dwell", 0.7}}, {}, -0.04, 0.06, 3, false},
      {"table", {}, {{"time", {1, 2, 4}}, {"value", {0, 1, -1}}}, -1, 1, 0, false},
      {"steps",
       {{"low", -0.05}, {"high", 0.05}, {"smallest", 0.01}, {"largest", 0.04}, {"shortest", 0.5}, {"longest", 1.6}},
       {},
       -0.05,
       0.05,
       0,
       true},
      {"chirp", {{"lowest", 0.5}, {"highest", 5}, {"sweep", 10}, {"amplitude", 2}, {"mean", 1}}, {}, -1, 3, 10, false},
  };
  return all;
}

Settings settings_of(const Case& c) { return Settings("test.yaml: profiles.test", c.numbers, c.lists, {}); }

std::vector<double> run(Excitation& excitation, double duration = 30) {
  std::vector<double> values;
  for (int k = 0; k <= static_cast<int>(duration * 1000); ++k) values.push_back(excitation.value(k * 1e-3));
  return values;
}

TEST(Excitation, EveryShapeHasACase) {
  std::set<std::string> tested;
  for (const Case& c : cases()) tested.insert(c.shape);
  for (const std::string& shape : excitation_shapes()) EXPECT_TRUE(tested.count(shape)) << shape;
}

TEST(Excitation, StaysInItsRangeAndUsesIt) {
  for (const Case& c : cases())
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      // A multisine reaches its peak once in its repetition of 10/0.11 s.
      const auto values = run(*make_excitation(c.shape, settings_of(c), seed), c.shape == "multisine" ? 91 : 30);
      const auto [low, high] = std::minmax_element(values.begin(), values.end());
      EXPECT_GE(*low, c.low - 1e-12) << c.shape << " seed " << seed;
      EXPECT_LE(*high, c.high + 1e-12) << c.shape << " seed " << seed;
      // The sum of sines rarely has all of them in phase.
      EXPECT_GE(*high - *low, (c.shape == "sines" ? 0.05 : 0.75) * (c.high - c.low)) << c.shape << " seed " << seed;
    }
}

TEST(Excitation, RepeatsAfterItsPeriod) {
  for (const Case& c : cases()) {
    if (c.period == 0) continue;
    const auto values = run(*make_excitation(c.shape, settings_of(c), 1));
    const auto lag = static_cast<std::size_t>(std::lround(c.period * 1000));
    double apart = 0;
    for (std::size_t k = 0; k + lag < values.size(); ++k)
      if (k % lag > 1 && k % lag < lag - 1 &&
          (c.shape != "square" || std::abs(static_cast<double>(k % lag) - 2000) > 2))
        apart = std::max(apart, std::abs(values[k + lag] - values[k]));
    EXPECT_LT(apart, 1e-9) << c.shape;
  }
}

TEST(Excitation, SeedDecides) {
  for (const Case& c : cases()) {
    const auto a = run(*make_excitation(c.shape, settings_of(c), 11)),
               b = run(*make_excitation(c.shape, settings_of(c), 11));
    EXPECT_EQ(a, b) << c.shape;
    const auto other = run(*make_excitation(c.shape, settings_of(c), 12));
    EXPECT_EQ(a != other, c.random) << c.shape;
  }
}

TEST(Excitation, SmallerTimeStartsOver) {
  for (const Case& c : cases()) {
    const auto excitation = make_excitation(c.shape, settings_of(c), 3);
    const auto first = run(*excitation, 10), second = run(*excitation, 10);
    std::size_t different = 0;
    for (std::size_t k = 0; k < first.size(); ++k) different += first[k] != second[k];
    EXPECT_EQ(different, 0u) << c.shape;
  }
}

TEST(Excitation, RefusesWhatItDoesNotKnow) {
  try {
    make_excitation("sawtooth", settings_of(cases()[0]), 1);
    FAIL() << "an unknown shape was taken";
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("sawtooth"), std::string::npos);
    EXPECT_NE(std::string(e.what()).find("multisine"), std::string::npos);
  }
  for (const Case& c : cases()) {
    Case more = c;
    more.numbers["surplus"] = 1;
    try {
      make_excitation(c.shape, settings_of(more), 1);
      ADD_FAILURE() << c.shape << " took an unknown setting";
    } catch (const InputError& e) {
      EXPECT_NE(std::string(e.what()).find("surplus"), std::string::npos) << c.shape;
    }
    for (const auto& [key, value] : c.numbers) {
      if (key == "mean" || key == "longest" || key == "smallest" || key == "largest") continue;
      Case less = c;
      less.numbers.erase(key);
      EXPECT_THROW(make_excitation(c.shape, settings_of(less), 1), InputError)
          << c.shape << " without " << key << value;
    }
  }
}

TEST(Excitation, KnownValues) {
  const auto square = make_excitation(
      "square", Settings("t", {{"low", 0}, {"high", 1}, {"period", 4}, {"duty", 0.25}, {"start", 2}}, {}, {}), 1);
  EXPECT_EQ(square->value(1.9), 0);
  EXPECT_EQ(square->value(2.5), 1);
  EXPECT_EQ(square->value(3.5), 0);
  EXPECT_EQ(square->value(6.5), 1);
  const auto triangle = make_excitation("triangle", Settings("t", {{"amplitude", 2}, {"period", 4}}, {}, {}), 1);
  for (const auto& [time, value] :
       std::vector<std::pair<double, double>>{{0, 0}, {0.5, 1}, {1, 2}, {2, 0}, {3, -2}, {3.5, -1}})
    EXPECT_NEAR(triangle->value(time), value, 1e-12) << time;
  const auto cycle = make_excitation("cycle", settings_of(cases()[7]), 1);
  EXPECT_NEAR(cycle->value(0.4), 0.01, 1e-12);
  EXPECT_NEAR(cycle->value(1.2), 0.06, 1e-12);
  EXPECT_NEAR(cycle->value(1.9), 0.01, 1e-12);
  EXPECT_NEAR(cycle->value(2.7), -0.04, 1e-12);
  const auto table = make_excitation("table", settings_of(cases()[8]), 1);
  EXPECT_NEAR(table->value(0), 0, 1e-12);
  EXPECT_NEAR(table->value(1.5), 0.5, 1e-12);
  EXPECT_NEAR(table->value(3), 0, 1e-12);
  EXPECT_NEAR(table->value(9), -1, 1e-12);
}

// A rig that is a thousand times as slow gets the same motion, stretched.
TEST(Excitation, AMultisineScalesWithItsCorner) {
  const auto multisine = [](double slow) {
    return make_excitation("multisine",
                           Settings("t",
                                    {{"count", 12},
                                     {"lowest", 0.2 / slow},
                                     {"highest", 5 / slow},
                                     {"amplitude", 2},
                                     {"corner", 1 / slow},
                                     {"fade", slow}},
                                    {}, {}),
                           4);
  };
  const auto fast = multisine(1), slow = multisine(1000);
  const auto plain = make_excitation(
      "multisine", Settings("t", {{"count", 12}, {"lowest", 0.2}, {"highest", 5}, {"amplitude", 2}}, {}, {}), 4);
  for (double t = 0; t < 20; t += 0.17) {
    const double value = fast->value(t);
    EXPECT_NEAR(slow->value(1000 * t), value, 2e-3) << t;  // the peak is looked for on a grid
    EXPECT_EQ(plain->value(t), value) << t;  // a corner of 1 Hz and a second of fading in, where none is given
  }
}

TEST(Excitation, StepsMayBeOfGivenSizes) {
  const Settings s("test",
                   {{"low", 0}, {"high", 1}, {"smallest", 0.2}, {"largest", 0.7}, {"shortest", 0.1}, {"longest", 0.2}},
                   {}, {});
  const auto values = run(*make_excitation("steps", s, 7), 300);
  double smallest = 1, largest = 0;
  for (std::size_t k = 1; k < values.size(); ++k) {
    const double step = std::abs(values[k] - values[k - 1]);
    if (step > 0) smallest = std::min(smallest, step);
    largest = std::max(largest, step);
  }
  EXPECT_GE(smallest, 0.2);
  EXPECT_LE(largest, 0.7);
  EXPECT_LT(smallest, 0.21);
  EXPECT_GT(largest, 0.65);
  const Settings wide(
      "test", {{"low", 0}, {"high", 1}, {"smallest", 0.6}, {"largest", 0.7}, {"shortest", 1}, {"longest", 1}}, {}, {});
  EXPECT_THROW(make_excitation("steps", wide, 1), InputError);  // from the middle there is no room for 0.6
}

TEST(Excitation, BinaryHoldsWholeClocks) {
  const auto values = run(*make_excitation("prbs", settings_of(cases()[6]), 2));
  std::size_t begin = 0;
  int changes = 0;
  for (std::size_t k = 1; k < values.size(); ++k) {
    EXPECT_GE(std::abs(values[k]), 1.0);
    if (values[k] == values[k - 1]) continue;
    const double clocks = static_cast<double>(k - begin) / 50;
    EXPECT_NEAR(clocks, std::round(clocks), 0.021) << k;
    EXPECT_LE(clocks, 7.03);
    EXPECT_LT(values[k] * values[k - 1], 0);  // the sign changes every time
    begin = k;
    ++changes;
  }
  EXPECT_GT(changes, 100);
}

}  // namespace
}  // namespace faultline
