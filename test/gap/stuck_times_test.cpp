// A transducer that is stuck tells since when; one that moves is no candidate.
#include "faultline/gap/stuck_times.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "faultline/gap/effect_search.h"
#include "faultline/numerics/random.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

constexpr double kPeriod = 1e-2, kNoise = 0.02;

// A sine that is held since a time; `noisy`: its readings have their noise from then on, too.
SegmentedRun held_since(double since, double duration, bool noisy, std::uint64_t seed) {
  SegmentedRun run;
  run.period = kPeriod;
  run.segment = 25;
  run.unsmoothed.resize(1);
  run.recording.channels.resize(1);
  Random random(seed);
  double held = 0;
  for (std::size_t k = 0; static_cast<double>(k) * kPeriod < duration; ++k) {
    const double t = static_cast<double>(k) * kPeriod;
    const double noise = kNoise * random.normal();
    if (t < since) held = std::sin(5 * t) + (noisy ? 0 : noise);
    run.recording.time.push_back(100 + t);
    run.recording.values.push_back(held + (noisy ? noise : 0));
  }
  return run;
}

std::vector<SegmentedRun> two_runs_with(const std::string& effect) {
  std::vector<SegmentedRun> runs;
  for (const std::uint64_t seed : {3, 4}) {
    SimulationSetup setup = servo_setup("multisine", seed);
    setup.effects = {parse_effect(effect)};
    runs.push_back(cut_run(servo(), "run", simulate(servo(), setup, 4), 0.25));
  }
  return runs;
}

TEST(StuckTimes, AreSeenInTheReadings) {
  for (const bool noisy : {false, true})
    for (const double since : {0.5, 3.3, 7.0, 9.5}) {
      const double found =
          still_since({held_since(since, 10, noisy, 1), held_since(since, 12, noisy, 2)}, 0, 0, kNoise);
      // Within what the sine needs to leave its noise.
      EXPECT_LE(found, since) << noisy;
      EXPECT_NEAR(found, since, 0.2) << noisy;
    }
}

TEST(StuckTimes, ASignalThatMovesInARunIsNotStuckUntilItsEnd) {
  EXPECT_EQ(still_since({held_since(3, 10, true, 1), held_since(100, 10, true, 2)}, 0, 0, kNoise), 10.0);
  EXPECT_EQ(still_since({held_since(100, 10.3, false, 1)}, 0, 0, 0), 10.3);
  SegmentedRun off = held_since(100, 10, true, 1);  // a wire that is off for the last 5 s
  std::fill(off.recording.values.begin() + 500, off.recording.values.end(), std::nan(""));
  EXPECT_EQ(still_since({off}, 0, 0, kNoise), 10.0);
}

TEST(StuckTimes, OnlyATransducerThatShowsOneValueIsACandidate) {
  const ResidualModel residuals(servo(), two_runs_with("stuck@sensor.load_pressure:from=2.2"));
  std::size_t stuck = 0;
  for (const Candidate& candidate : where_still(candidates(servo(), {}, 4), residuals)) {
    if (candidate.family != "stuck" || port_kind(candidate.effect.port) != PortKind::sensor) continue;
    EXPECT_EQ(candidate.effect.port, "sensor.load_pressure");
    EXPECT_LT(candidate.bounds.front().minimum, 2.2);
    EXPECT_GT(candidate.bounds.front().maximum, 2.2);
    EXPECT_LT(candidate.bounds.front().maximum - candidate.bounds.front().minimum, 0.5);
    ++stuck;
  }
  EXPECT_EQ(stuck, 1u);
}

TEST(StuckTimes, ACommandThatIsStuckIsNotFollowed) {
  constexpr double kSince = 2.6;
  const ResidualModel residuals(servo(), two_runs_with("stuck@command.valve_command:from=2.6"));
  EXPECT_NEAR(not_followed_since(residuals), kSince, 0.25);
  std::size_t near = 0;
  for (const Candidate& candidate : where_still(candidates(servo(), {}, 4), residuals)) {
    if (candidate.effect.effect != "stuck" || candidate.effect.port != "command.valve_command") continue;
    const Bounds& bounds = candidate.bounds.front();
    EXPECT_TRUE(bounds.minimum < kSince && bounds.maximum > kSince) << bounds.minimum << " " << bounds.maximum;
    near += bounds.maximum - bounds.minimum < 1;
  }
  EXPECT_EQ(near, 1u);
}

}  // namespace
}  // namespace faultline
