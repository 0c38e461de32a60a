// Choosing noise and thresholds from healthy runs.
#include <cmath>

#include <gtest/gtest.h>

#include "faultline/numerics/random.h"
#include "faultline/signal/error.h"
#include "faultline/tuning/noise_tuning.h"
#include "faultline/tuning/threshold_tuning.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

TEST(Gumbel, FindsLocationAndScale) {
  Random random(4);
  std::vector<double> maxima;
  for (int i = 0; i < 4000; ++i) maxima.push_back(5 - 2 * std::log(-std::log(random.uniform(1e-12, 1))));
  const Gumbel g = fit_gumbel(maxima);
  EXPECT_NEAR(g.location, 5, 0.15);
  EXPECT_NEAR(g.scale, 2, 0.1);
  // Once in a hundred blocks: exceeded by about one in a hundred of them.
  const double level = g.level(0.01 / 10, 10);
  int above = 0;
  for (const double m : maxima) above += m > level;
  EXPECT_NEAR(above / 4000.0, 0.01, 0.005);
}

TEST(NoiseTuning, KnowsTheRandomWalks) {
  const std::vector<bool> walks = random_walks(servo(), servo().estimators.front());
  ASSERT_EQ(walks.size(), 6u);
  EXPECT_EQ(walks, (std::vector<bool>{false, false, false, false, true, true}));
}

TEST(NoiseTuning, MakesInnovationsConsistent) {
  const NoiseTuning tuned =
      tune_noise(servo(), servo().estimators.front(), {simulate(servo(), off_nominal("square", 7), 12)});
  ASSERT_EQ(tuned.after.size(), 4u);
  EXPECT_GT(tuned.likelihood_after, tuned.likelihood_before + 10);
  for (const InnovationQuality& row : tuned.after) {
    EXPECT_LT(std::abs(row.whiteness), 0.15) << row.name;
    // The friction correction takes up part of the velocity's innovation: there the filter is too cautious.
    if (row.name == "velocity")
      EXPECT_NEAR(row.consistency, 0.35, 0.15);
    else
      EXPECT_NEAR(row.consistency, 1, 0.15) << row.name;
  }
  // The noise of the recording is found again, over the printed 1e-6 and 1e-2.
  const auto noise = [](const char* channel) { return servo().channels[column(channel)].noise_std; };
  EXPECT_NEAR(std::sqrt(tuned.measurement_noise[0]) / noise("position"), 1, 0.1);
  EXPECT_NEAR(std::sqrt(tuned.measurement_noise[3]) / noise("spool_position"), 1, 0.1);
  // What a healthy run cannot tell stays.
  const std::vector<double> printed = servo().estimators.front().settings.list("process_noise", 6, 0, 1e12);
  EXPECT_EQ(tuned.process_noise[4], printed[4]);
  EXPECT_EQ(tuned.process_noise[5], printed[5]);
}

TEST(NoiseTuning, StoppedItGivesTheBestSoFar) {
  const std::vector<Recording> healthy = {simulate(servo(), off_nominal("square", 7), 12)};
  int left = 30;  // times it may ask, twice or three times an entry
  const NoiseTuning stopped = tune_noise(servo(), servo().estimators.front(), healthy, {}, [&] { return left-- <= 0; });
  EXPECT_FALSE(stopped.finished);
  EXPECT_GT(stopped.likelihood_after, stopped.likelihood_before);
  const NoiseTuning none = tune_noise(servo(), servo().estimators.front(), healthy, {}, [] { return true; });
  EXPECT_FALSE(none.finished);
  EXPECT_EQ(none.likelihood_after, none.likelihood_before);
}

TEST(Thresholds, RiseAsAlarmsMustBeRarer) {
  const std::vector<Recording> healthy = {simulate(servo(), off_nominal("square", 7), 100)};
  const StageSpec& stage = servo().estimators.front();
  const std::vector<Threshold> often = tune_thresholds(servo(), stage, healthy, 10, 10);
  const std::vector<Threshold> rarely = tune_thresholds(servo(), stage, healthy, 0.01, 10);
  ASSERT_FALSE(often.empty());
  ASSERT_EQ(often.size(), rarely.size());
  for (std::size_t i = 0; i < often.size(); ++i) {
    EXPECT_LT(often[i].chosen, rarely[i].chosen) << often[i].detector;
    EXPECT_GE(rarely[i].upper, rarely[i].chosen) << rarely[i].detector;
    // The shipped thresholds are wider than one false alarm in 100 hours needs, whatever is asked for here.
    EXPECT_LT(rarely[i].rate_as_set, 0.01) << rarely[i].detector;
    EXPECT_EQ(rarely[i].rate_as_set, often[i].rate_as_set) << rarely[i].detector;
    EXPECT_LT(rarely[i].chosen, rarely[i].set) << rarely[i].detector;
  }
  EXPECT_THROW(tune_thresholds(servo(), stage, {simulate(servo(), servo_setup("square"), 20)}, 1, 10), InputError);
}

TEST(TradeOff, FewerFalseAlarmsCostDelay) {
  SimulationSetup leaking = off_nominal("square", 8);
  open_bypass(leaking, 20, 3);
  const std::vector<TradeOff> trade =
      trade_off(servo(), servo().estimators.front(), "internal_leak", 4, {0.1, 1}, {1, 0.01},
                {simulate(servo(), off_nominal("square", 7), 100)}, {{simulate(servo(), leaking, 40), 20}}, 10);
  ASSERT_EQ(trade.size(), 4u);
  EXPECT_LT(trade[0].threshold, trade[1].threshold);
  for (const TradeOff& t : trade) {
    ASSERT_FALSE(std::isnan(t.delays[0])) << t.value << " " << t.rate;
    EXPECT_GT(t.delays[0], 1) << t.value << " " << t.rate;  // the detector wants a second of evidence
    EXPECT_LT(t.delays[0], 3) << t.value << " " << t.rate;
  }
  EXPECT_LT(trade[0].delays[0], trade[1].delays[0]);
  EXPECT_LT(trade[3].delays[0], trade[1].delays[0]);  // a faster walk is a faster filter
}

}  // namespace
}  // namespace faultline
