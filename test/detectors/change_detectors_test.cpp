// CUSUM, redline, innovation test, frozen and noisy in numbers: delay, size, learning, arming, false alarms.
#include <gtest/gtest.h>

#include <array>
#include <map>
#include <utility>

#include "faultline/detectors/detector.h"
#include "faultline/detectors/run_length.h"
#include "faultline/numerics/random.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

std::unique_ptr<Detector> make(const std::string& type, std::map<std::string, double> numbers, bool arming = false) {
  numbers.insert({{"minimum_time", 0}, {"release_time", 0}});
  if (type == "frozen") numbers.erase("minimum_time");
  std::map<std::string, std::string> words = {{"quantity", "x"}};
  if (arming) words["armed_by"] = "armed", numbers["armed_above"] = 0.5;
  return make_detector(Datasheet(), {type, type, Settings("test", numbers, {}, words)});
}

// Feeds values at 1 kHz; remembers when it spoke.
struct Feeder {
  explicit Feeder(Detector& d) : detector(d) {}
  bool feed(double value, double armed = 1, double surprise = 0) {
    Estimate estimate;
    estimate.time = 1e-3 * k++;
    estimate.restarted = std::exchange(restarted, false);
    estimate.quantities = {{"x", "Pa", value, 0}, {"armed", "1", armed, 0}, {"surprise", "1", surprise, 0}};
    detector.process(estimate, detection);
    return detection.active;
  }
  void lose(int samples) {  // the stage before begins anew
    k += samples;
    restarted = true;
  }
  Detector& detector;
  Detection detection;
  int k = 0;
  bool restarted = true;
};

TEST(CusumDetector, PaperSettingsOnAStep) {
  // delta 0.5 % of 0.0018, lambda 3 delta: a step of 0.9 % gains 1.3 delta a sample and is there with the third sample.
  const auto detector = make("cusum", {{"relative_change", 0.005}, {"threshold_changes", 3}, {"reference", 0.0018}});
  Feeder run(*detector);
  for (int k = 0; k < 1000; ++k) ASSERT_FALSE(run.feed(0.0018 * 1.002));
  int delay = 1;
  while (!run.feed(0.0018 * 0.991)) ++delay;
  EXPECT_EQ(delay, 3);
  EXPECT_EQ(run.detection.since, 1.0);
  EXPECT_NEAR(run.detection.size, -0.009 * 0.0018, 1e-12);
  EXPECT_EQ(detector->size_unit(), "Pa");
  int more = 0;
  while (run.feed(0.0018)) ++more;
  EXPECT_LE(more, 13);  // from twice lambda down to lambda, half a delta a sample
}

TEST(CusumDetector, FalseAlarmsAreThoseAskedFor) {
  const double per_hour = 3600;  // one a second, to count some
  const auto detector = make(
      "cusum", {{"change", 1}, {"noise", 1}, {"period", 1e-3}, {"false_alarms_per_hour", per_hour}, {"reference", 5}});
  Feeder run(*detector);
  Random random(3);
  int alarms = 0;
  for (int k = 0; k < 3000000; ++k)
    if (run.feed(5 + random.normal())) {
      ++alarms;
      detector->reset();
    }
  EXPECT_NEAR(alarms / 3000.0, 1, 0.08);
}

TEST(CusumDetector, WhatItLearntOutlastsAGap) {
  const auto detector = make("cusum", {{"change", 1}, {"threshold_changes", 5}, {"learn", 0.5}}, true);
  Feeder run(*detector);
  for (int k = 0; k < 300; ++k) run.feed(7);
  run.lose(200);
  for (int k = 0; k < 501; ++k) ASSERT_FALSE(run.feed(7));  // what was not learnt to its end is learnt anew
  run.lose(200);
  for (int k = 0; k < 100; ++k) ASSERT_FALSE(run.feed(9, 0));
  int delay = 1;
  while (!run.feed(9) && delay < 100) ++delay;
  EXPECT_EQ(delay, 4);
}

TEST(RedlineDetector, LearnsAnewAfterAGapAndKeepsItsFirstReference) {
  const auto detector = make("redline", {{"margin", 1}, {"learn", 0.2}});
  Feeder run(*detector);
  for (int k = 0; k < 300; ++k) ASSERT_FALSE(run.feed(7));
  run.lose(500);
  for (int k = 0; k < 300; ++k) ASSERT_FALSE(run.feed(9));  // the bench was set otherwise
  EXPECT_TRUE(run.feed(11));
  EXPECT_EQ(detector->reference()->numbers, std::vector<double>{7});
}

TEST(CusumDetector, LearnsItsReferenceOnceArmed) {
  const auto detector = make("cusum", {{"change", 1}, {"threshold_changes", 5}, {"learn", 0.5}}, true);
  Feeder run(*detector);
  for (int k = 0; k < 300; ++k) ASSERT_FALSE(run.feed(1000, 0));  // not armed: neither learnt nor judged
  for (int k = 0; k < 2000; ++k) ASSERT_FALSE(run.feed(7 + (k % 2 ? 0.2 : -0.2)));
  for (int k = 0; k < 100; ++k) ASSERT_FALSE(run.feed(1000, 0));
  for (int k = 0; k < 100; ++k) ASSERT_FALSE(run.feed(7));  // the reference outlives a pause
  int delay = 1;
  while (!run.feed(9)) ++delay;
  EXPECT_EQ(delay, 4);  // 1.5 a sample up to 5
  EXPECT_FALSE(run.feed(9, 0));
}

TEST(CusumDetector, ARestoredReferenceNeedsNoLearning) {
  const std::map<std::string, double> settings = {{"change", 1}, {"threshold_changes", 5}, {"learn", 0.5}};
  const auto learner = make("cusum", settings, true);
  Feeder healthy(*learner);
  for (int k = 0; k < 500; ++k) {
    healthy.feed(7);
    ASSERT_FALSE(learner->reference().has_value()) << k;  // not learnt yet
  }
  healthy.feed(7);
  ASSERT_TRUE(learner->reference().has_value());
  EXPECT_EQ(learner->reference()->numbers, std::vector<double>{7});

  const auto detector = make("cusum", settings, true);
  detector->restore(*learner->reference());
  Feeder run(*detector);
  for (int pass = 0; pass < 2; ++pass) {
    int delay = 1;
    while (!run.feed(9)) ++delay;
    EXPECT_EQ(delay, 4);  // 1.5 a sample up to 5, from the first on
    detector->reset();    // forgets what it saw, not what it was told
    ASSERT_TRUE(detector->reference().has_value());
    EXPECT_EQ(detector->reference()->numbers, std::vector<double>{7});
  }
  const auto given = make("cusum", {{"change", 1}, {"threshold_changes", 5}, {"reference", 7}});
  EXPECT_FALSE(given->reference().has_value());
  EXPECT_THROW(given->restore(*learner->reference()), InputError);
}

TEST(RedlineDetector, NeedsItsMarginForItsTime) {
  const auto detector = make("redline", {{"relative_margin", 0.05}, {"learn", 0.2}, {"minimum_time", 0.2}}, true);
  Feeder run(*detector);
  for (int k = 0; k < 500; ++k) ASSERT_FALSE(run.feed(100));
  for (int k = 0; k < 1000; ++k) ASSERT_FALSE(run.feed(104.9));
  for (int k = 0; k < 199; ++k) ASSERT_FALSE(run.feed(105.1));
  ASSERT_FALSE(run.feed(104.9));
  int delay = 0;
  while (!run.feed(94.9)) ++delay;
  EXPECT_EQ(delay, 200);
  EXPECT_NEAR(run.detection.since, 1.7, 1e-9);
  EXPECT_EQ(run.detection.size, 94.9);
  // Armed anew it learns anew: an operating point of its own.
  EXPECT_FALSE(run.feed(50, 0));
  for (int k = 0; k < 1000; ++k) ASSERT_FALSE(run.feed(50));
}

TEST(RedlineDetector, ARestoredReferenceHoldsForItsFirstArming) {
  const std::map<std::string, double> settings = {
      {"relative_margin", 0.05}, {"learn", 0.2}, {"minimum_time", 0.2}, {"release_time", 0.5}};
  const auto learner = make("redline", settings, true);
  Feeder healthy(*learner);
  for (int k = 0; k < 300; ++k) healthy.feed(100);
  healthy.feed(0, 0);
  for (int k = 0; k < 300; ++k) healthy.feed(50);
  ASSERT_TRUE(learner->reference().has_value());
  EXPECT_NEAR(learner->reference()->numbers[0], 100, 1e-9);  // the first, not the latest

  const auto detector = make("redline", settings, true);
  detector->restore(*learner->reference());
  ASSERT_TRUE(detector->reference().has_value());  // before the first sample, too
  Feeder run(*detector);
  for (int k = 0; k < 300; ++k) ASSERT_FALSE(run.feed(0, 0));
  int delay = 0;
  while (!run.feed(110)) ++delay;
  EXPECT_EQ(delay, 200);  // off from the start, and told after the minimum time
  // While it ends, its size stays what it was when it was there.
  for (int k = 0; k < 400; ++k) ASSERT_TRUE(run.feed(101));
  EXPECT_EQ(run.detection.size, 110);
  run.feed(0, 0);
  for (int k = 0; k < 1000; ++k) ASSERT_FALSE(run.feed(50));  // of the next operating point it learns anew
}

TEST(InnovationTest, SilentOnWhiteNoiseAndQuickOnMore) {
  const auto detector =
      make("innovation_test", {{"window", 100}, {"noise", 2}, {"period", 1e-3}, {"false_alarms_per_hour", 0.1}});
  Feeder run(*detector);
  Random random(6);
  for (int k = 0; k < 600000; ++k) ASSERT_FALSE(run.feed(2 * random.normal())) << k;
  int delay = 1;
  while (!run.feed(2 * random.normal() + 6)) ++delay;
  EXPECT_LT(delay, 25);
  EXPECT_GT(run.detection.size, 1.5);
}

TEST(FrozenDetector, CountsEqualNumbers) {
  const auto detector = make("frozen", {{"count", 10}});
  Feeder run(*detector);
  for (int k = 0; k < 100; ++k) ASSERT_FALSE(run.feed(k / 5));  // never more than five
  for (int k = 0; k < 9; ++k) ASSERT_FALSE(run.feed(77));
  EXPECT_TRUE(run.feed(77));
  EXPECT_NEAR(run.detection.since, 0.1, 1e-9);
  EXPECT_FALSE(run.feed(78));
}

TEST(NoisyDetector, KnowsNoiseFromAStepAndARamp) {
  const auto detector = make("noisy", {{"noise", 1}, {"limit", 3}, {"window", 10}, {"release_time", 0.5}});
  Feeder run(*detector);
  Random random(8);
  double level = 0;
  for (int k = 0; k < 100000; ++k) {
    if (k % 1000 == 999) level += k % 2000 > 1000 ? -40 : 40;  // steps of forty sigma
    level += 0.05;
    ASSERT_FALSE(run.feed(level + random.normal())) << k;
  }
  int delay = 1;
  while (!run.feed(level + 10 * random.normal())) ++delay;
  EXPECT_LE(delay, 15);
  for (int k = 0; k < 3000; ++k) run.feed(level + 10 * random.normal());
  EXPECT_NEAR(run.detection.size, std::sqrt(99), 0.8);
  EXPECT_LT(run.detection.low, std::sqrt(99));
  EXPECT_GT(run.detection.high, std::sqrt(99));
}

// Transducers that were always noisier than their datasheet says are in good order.
TEST(NoisyDetector, TakesARigsOwnNoiseForItsOwn) {
  const std::map<std::string, double> settings = {{"noise", 1}, {"limit", 3}, {"window", 10}, {"release_time", 0.5}};
  const auto detector = make("noisy", settings);
  Feeder run(*detector);
  Random random(9);
  for (int k = 0; k < 200000; ++k) ASSERT_FALSE(run.feed(2.2 * random.normal())) << k;
  int delay = 1;
  while (!run.feed(22 * random.normal())) ++delay;
  EXPECT_LE(delay, 15);
  for (int k = 0; k < 3000; ++k) run.feed(22 * random.normal());
  EXPECT_NEAR(run.detection.size, 22 * std::sqrt(0.99), 1);

  // More than the limit from the first sample on is not.
  const auto other = make("noisy", settings);
  Feeder bad(*other);
  int told = 0;
  for (int k = 0; k < 20000; ++k) told += bad.feed(6 * random.normal());
  EXPECT_GT(told, 19000);
  EXPECT_NEAR(bad.detection.size, std::sqrt(35), 0.4);
  const auto quieter = make("noisy", settings);
  Feeder quiet(*quieter);
  for (int k = 0; k < 20000; ++k) ASSERT_FALSE(quiet.feed(0.2 * random.normal()));
  for (int k = 0; k < 20000; ++k) ASSERT_FALSE(quiet.feed(random.normal()));  // no more than the datasheet's
}

std::unique_ptr<Detector> noisy_with_innovation() {
  const Settings settings("test",
                          {{"noise", 1}, {"limit", 3}, {"window", 10}, {"minimum_time", 0}, {"release_time", 0.5}}, {},
                          {{"quantity", "x"}, {"innovation", "surprise"}});
  return make_detector(Datasheet(), {"noisy", "noisy", settings});
}

// What a filter foresees is motion, however fast; noise surprises it.
TEST(NoisyDetector, AFastMotionThatIsForeseenIsNoNoise) {
  const auto detector = noisy_with_innovation();
  Feeder run(*detector);
  Random random(12);
  for (int k = 0; k < 50000; ++k) {
    const double noise = random.normal();
    ASSERT_FALSE(run.feed(30 * random.normal() + noise, 1, noise)) << k;
  }
  int delay = 1;
  const auto noisy = [&] {
    const double noise = 10 * random.normal();
    return run.feed(30 * random.normal() + noise, 1, noise);
  };
  while (!noisy()) ASSERT_LT(++delay, 100);
  EXPECT_LE(delay, 15);
}

// A model that is wrong foresees nothing of it, but it is not white.
TEST(NoisyDetector, AFastMotionThatIsNotWhiteIsNoNoise) {
  const auto detector = noisy_with_innovation();
  Feeder run(*detector);
  Random random(13);
  std::array<double, 60> phase;
  for (double& p : phase) p = random.uniform(0, 2 * M_PI);
  const auto motion = [&](int k) {
    double sum = 0;
    for (std::size_t i = 0; i < phase.size(); ++i)
      sum += 4 * std::sin(2 * M_PI * 0.3 * static_cast<double>(i + 1) / 60.5 * k + phase[i]);
    return sum;
  };
  int told = 0;
  for (int k = 0; k < 20000; ++k) told += run.feed(motion(k) + random.normal(), 1, motion(k));
  EXPECT_EQ(told, 0);
}

// Noise beside the limit neither comes and goes nor, from the first sample on, counts for more than it is.
TEST(NoisyDetector, BesideTheLimitItDoesNotFlicker) {
  const std::map<std::string, double> settings = {{"noise", 1}, {"limit", 3}, {"window", 10}, {"release_time", 0.5}};
  const auto always = make("noisy", settings);
  Feeder from_the_start(*always);
  Random random(10);
  for (int k = 0; k < 20000; ++k) ASSERT_FALSE(from_the_start.feed(3 * random.normal())) << k;
  const auto later = make("noisy", settings);
  Feeder run(*later);
  for (int k = 0; k < 5000; ++k) ASSERT_FALSE(run.feed(random.normal())) << k;
  int raised = 0;
  bool told = false;
  for (int k = 0; k < 20000; ++k) {
    const bool now = run.feed(3.2 * random.normal());
    raised += now && !told;
    told = now;
  }
  EXPECT_TRUE(told);
  EXPECT_EQ(raised, 1);
}

TEST(InnovationTest, TakesTheNoiseOfTheRigForGranted) {
  const auto detector =
      make("innovation_test", {{"window", 100}, {"noise", 1}, {"period", 1e-3}, {"false_alarms_per_hour", 0.1}});
  Feeder run(*detector);
  Random random(7);
  for (int k = 0; k < 1500; ++k)
    ASSERT_FALSE(run.feed(2 * random.normal() + (k < 300 ? 2 : 0))) << k;  // finds its state
  for (int k = 0; k < 300000; ++k) ASSERT_FALSE(run.feed(2 * random.normal())) << k;
  int delay = 1;
  while (!run.feed(2 * random.normal() + 6)) ++delay;
  EXPECT_LT(delay, 50);
  // What never fits is told all the same.
  const auto other =
      make("innovation_test", {{"window", 100}, {"noise", 1}, {"period", 1e-3}, {"false_alarms_per_hour", 0.1}});
  Feeder never(*other);
  int after = 1;
  while (!never.feed(random.normal() + 4) && after < 20000) ++after;
  EXPECT_LT(after, 6000);
}

TEST(RippleDetector, NoiseThatIsTwiceTheDatasheetsDoesNotSwing) {
  const std::map<std::string, double> settings = {
      {"limit", 4.7}, {"swings", 4}, {"average", 0.6}, {"noise", 1}, {"release_time", 0.6}};
  const auto detector = make("ripple", settings);
  Feeder run(*detector);
  Random random(10);
  for (int k = 0; k < 60000; ++k) ASSERT_FALSE(run.feed(2.5 * random.normal())) << k;
  int delay = 1;
  for (; delay < 2000; ++delay)
    if (run.feed(2.5 * random.normal() + 30 * std::sin(0.12 * delay))) break;
  EXPECT_LT(delay, 600);
  for (int k = 0; k < 600; ++k) run.feed(2.5 * random.normal() + 30 * std::sin(0.12 * (delay + k)));
  EXPECT_NEAR(run.detection.size, 30, 2);
}

TEST(Detectors, RefuseWhatContradictsItself) {
  EXPECT_THROW(make("cusum", {{"change", 1}}), InputError);                            // no threshold
  EXPECT_THROW(make("cusum", {{"change", 1}, {"threshold_changes", 3}}), InputError);  // no reference
  EXPECT_THROW(make("redline", {{"margin", -1}, {"expected", 0}}), InputError);
  EXPECT_THROW(make("frozen", {{"count", 1}}), InputError);
}

}  // namespace
}  // namespace faultline
