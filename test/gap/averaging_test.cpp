// Readings of a rig that shows nothing between them are averaged, unless they swing.
#include "faultline/gap/averaging.h"

#include <gtest/gtest.h>

#include <cmath>

#include "rigs/cooling_circuit/recordings.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

std::size_t rows_of(const std::vector<std::string>& effects, double period = 0) {
  SimulationSetup setup = cooling_recording("valve_steps", 7);
  for (const std::string& effect : effects) setup.effects.push_back(parse_effect(effect));
  setup.sample_period = period;
  const Recording recording = simulate(cooling(), setup, 6), healthy = simulate(cooling(), cooling_setup("paper"), 6);
  return rows_to_average(cooling(), {&healthy, &recording});
}

TEST(Averaging, IsOverFiveMillisecondsOfTheCoolingCircuit) {
  EXPECT_EQ(rows_of({}), 5u);
  EXPECT_EQ(rows_of({"orifice_leakage@flow.t_outlet_ambient:coefficient=1e-7"}), 5u);
}

TEST(Averaging, IsOverLessWhereOneRunSwingsFasterThanItsMeans) {
  EXPECT_EQ(rows_of({"ripple@source.t_drain:amplitude=1e5,frequency=90"}), 1u);
  EXPECT_EQ(rows_of({"ripple@source.supply:amplitude=3e4,frequency=45"}), 3u);
  EXPECT_EQ(rows_of({"ripple@source.supply:amplitude=3e4,frequency=4"}), 5u);
}

// Noise makes such lines among thousands of frequencies.
TEST(Averaging, IsDoneWhereALineIsMuchLessThanTheNoise) {
  Recording recording = simulate(cooling(), cooling_recording("valve_steps", 7), 20);
  const std::size_t column = cooling_column("v2_outlet_temperature");
  const auto swing = [&](double amplitude) {
    for (std::size_t k = 0; k < recording.rows(); ++k)
      recording.values[k * recording.columns() + column] += amplitude * std::sin(565.49 * recording.time[k]);
    return rows_to_average(cooling(), {&recording});
  };
  const double noise = cooling().channels[column].noise_std;
  EXPECT_EQ(swing(0.1 * noise), 5u);
  EXPECT_EQ(swing(noise), 1u);
}

TEST(Averaging, IsNotDoneOfRigsThatShowSomethingInEverySample) {
  const Recording recording = simulate(servo(), servo_setup("multisine"), 3);
  EXPECT_EQ(rows_to_average(servo(), {&recording}), 1u);
}

TEST(Averaging, MakesLimitsInVariancesOfAReadingLargerAndLeavesTheOthers) {
  const GapOptions own, averaged = for_averages(own, 5);
  EXPECT_EQ(averaged.verdict.quiet_excess_variances, 5 * own.verdict.quiet_excess_variances);
  EXPECT_EQ(averaged.onset.least_step_variances, 5 * own.onset.least_step_variances);
  EXPECT_EQ(averaged.verdict.place_log_likelihood, 5 * own.verdict.place_log_likelihood);
  EXPECT_EQ(averaged.verdict.beside_log_likelihood, own.verdict.beside_log_likelihood);
  EXPECT_EQ(averaged.segments.start_misfit_variances, own.segments.start_misfit_variances);
}

}  // namespace
}  // namespace faultline
