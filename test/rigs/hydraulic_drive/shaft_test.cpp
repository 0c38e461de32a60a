// The stage `shaft` of the shipped datasheet on recordings of the rig: the paper's relative changes and delay, healthy
// estimates with intervals that hold, and rigs off their datasheet. Another simulation step and the whole plant are
// behind the recordings; the estimator knows one equation of it.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "faultline/estimators/estimator_stage.h"
#include "rigs/hydraulic_drive/runs.h"

namespace faultline {
namespace {

using Three = std::array<double, 3>;

struct Course {
  std::vector<Three> value, std;
  Three mean(std::size_t from, std::size_t to) const {
    Three sum{};
    for (std::size_t k = from; k < to; ++k)
      for (std::size_t i = 0; i < 3; ++i) sum[i] += value[k][i] / static_cast<double>(to - from);
    return sum;
  }
};

StageSpec shipped() { return drive().estimators[drive().estimator("shaft")]; }

Course estimated(const SimulationSetup& setup, double duration = 30, const StageSpec& spec = shipped()) {
  const Recording run = simulate(drive(), setup, duration);
  EstimatorStage stage(drive(), spec);
  Estimate estimate;
  Course course;
  for (std::size_t k = 0; k < run.rows(); ++k) {
    stage.process(run.sample(k), estimate);
    Three value{}, std{};
    for (std::size_t i = 0; i < 3; ++i) {
      value[i] = estimate.quantities[i].value;
      std[i] = estimate.quantities[i].std;
    }
    course.value.push_back(value);
    course.std.push_back(std);
  }
  return course;
}

Three truth(const std::vector<double>& parameters) {
  const auto p = [&](const char* name) { return parameters[static_cast<std::size_t>(drive().parameter(name))]; };
  return {-p("viscous_friction") / p("inertia"), p("displacement") * p("motor_efficiency") / p("inertia"),
          -p("displacement") / (p("inertia") * p("pump_efficiency"))};
}

SimulationSetup with_fault(const std::string& name, std::uint64_t seed) {
  SimulationSetup setup = drive_off_nominal("paper", seed);
  for (const std::string& effect : drive().fault(name).effects) setup.effects.push_back(parse_effect(effect));
  return setup;
}

// Samples until all three stay within half a change of 10 % for half a second.
std::size_t delay(const Course& course, const Three& target, std::size_t from) {
  std::size_t quiet = 0;
  for (std::size_t k = from; k < course.value.size(); ++k) {
    bool near = true;
    for (std::size_t i = 0; i < 3; ++i) near = near && std::abs(course.value[k][i] / target[i] - 1) < 0.05;
    quiet = near ? quiet + 1 : 0;
    if (quiet == 50) return k + 1 - 50 - from;
  }
  return course.value.size();
}

struct PaperFault {
  const char *set, *symbol;
  std::size_t at, until;  // samples
  Three factors;          // what a perfect estimator would see
};

// What the paper's nine faults do to a11, a12, a13: (19).
const PaperFault kFaults[] = {
    {"set_1", "eta_m", 200, 1600, {1, 1.1, 1}},
    {"set_1", "eta_p", 1600, 3000, {1, 1, 1 / 1.1}},
    {"set_2", "I", 200, 1600, {1 / 1.1, 1 / 1.1, 1 / 1.1}},
    {"set_2", "D", 1600, 3000, {1.1, 1, 1}},
    {"set_3", "C_r", 200, 1400, {1, 1.1, 1.1}},
    {"set_3", "K_0", 1400, 1800, {1, 1, 1}},
    {"set_3", "K_l", 1800, 2200, {1, 1, 1}},
    {"set_3", "V_t", 2200, 2600, {1, 1, 1}},
    {"set_3", "B", 2600, 3000, {1, 1, 1}},
};

class PaperFaults : public ::testing::TestWithParam<bool> {};

// The memory of the paper, and the longer one that docs/hydraulic_drive.md recommends: it scatters half as much, so
// that the delay is that of the fault and not of the noise.
TEST_P(PaperFaults, MoveWhatThePaperSaysByAsMuch) {
  const bool longer = GetParam();
  StageSpec spec = shipped();
  if (longer) {
    spec.settings.set("forgetting", 0.98);
    spec.settings.set("renewal", 6);
  }
  std::size_t late = 0, moving = 0;
  for (std::uint64_t seed = 31; seed <= 34; ++seed) {
    Three factors{};
    Course course;
    for (const PaperFault& fault : kFaults) {
      SCOPED_TRACE(std::string(fault.symbol) + " seed " + std::to_string(seed));
      if (fault.at == 200) {
        course = estimated(with_fault(fault.set, seed), 30, spec);
        factors = {1, 1, 1};
      }
      for (std::size_t i = 0; i < 3; ++i) factors[i] *= fault.factors[i];
      Three target = truth(draw_parameters(drive(), seed));
      for (std::size_t i = 0; i < 3; ++i) target[i] *= factors[i];
      const Three after = course.mean(fault.at + std::min<std::size_t>(400, (fault.until - fault.at) / 2), fault.until);
      // a11 scatters by twice what the others do.
      EXPECT_NEAR(after[0] / target[0], 1, 0.06);
      EXPECT_NEAR(after[1] / target[1], 1, 0.035);
      EXPECT_NEAR(after[2] / target[2], 1, 0.035);
      if (fault.factors == Three{1, 1, 1}) continue;
      ++moving;
      late += delay(course, target, fault.at) > 250;
    }
  }
  EXPECT_EQ(moving, 20u);
  EXPECT_LE(late, longer ? 0u : 4u);
}

INSTANTIATE_TEST_SUITE_P(Shaft, PaperFaults, ::testing::Bool(),
                         [](const auto& which) { return which.param ? "longer_memory" : "shipped"; });

TEST(Shaft, HealthyEstimatesAreWithinTheirIntervals) {
  std::size_t within[3] = {}, count = 0;
  for (std::uint64_t seed = 41; seed <= 46; ++seed) {
    const Three exact = truth(draw_parameters(drive(), seed));
    const Course course = estimated(drive_off_nominal("paper", seed));
    for (std::size_t k = 200; k < course.value.size(); ++k, ++count)
      for (std::size_t i = 0; i < 3; ++i)
        within[i] += std::abs(course.value[k][i] - exact[i]) < 1.645 * course.std[k][i];
  }
  for (const std::size_t inside : within) {
    EXPECT_GT(static_cast<double>(inside), 0.84 * static_cast<double>(count));
    EXPECT_LT(static_cast<double>(inside), 0.96 * static_cast<double>(count));
  }
}

TEST(Shaft, WithoutNoiseInterpolationIsAllThatIsLeft) {
  const Course course = estimated(drive_plain("paper"));
  const Three exact = truth(drive().nominal());
  for (std::size_t k = 300; k < course.value.size(); ++k)
    for (std::size_t i = 0; i < 3; ++i) ASSERT_NEAR(course.value[k][i] / exact[i], 1, i == 0 ? 1e-2 : 3e-3) << k;
  // The paper's fault-free numbers, in its units.
  const Three mean = course.mean(300, 3000);
  const double rpm_per_bar = 30 / 3.14159265358979 * 1e5;
  EXPECT_NEAR(mean[0], -8.8, 0.02);
  EXPECT_NEAR(mean[1] * rpm_per_bar, 828.9, 1);
  EXPECT_NEAR(mean[2] * rpm_per_bar, -1144.9, 1.4);
}

TEST(Shaft, StandstillWidensTheIntervalsInsteadOfTheEstimatesRunningAway) {
  // Nothing moves: load and motor pressure hold each other, and only their ratio is seen.
  SimulationSetup setup = drive_off_nominal("steady", 7);
  const Course course = estimated(setup, 60);
  const Three exact = truth(draw_parameters(drive(), 7));
  for (std::size_t k = 3000; k < course.value.size(); ++k) {
    ASSERT_NEAR(course.value[k][1] / exact[1], 1, 0.5) << k;
    ASSERT_GT(course.std[k][1], 0.01 * exact[1]) << k;
  }
}

}  // namespace
}  // namespace faultline
