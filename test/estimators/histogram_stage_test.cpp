// The estimator `histogram` on a plant of three lines: what it tells of shifts and of what explains them, what it
// leaves out, how it is kept and restored.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "allocations.h"
#include "faultline/estimators/estimator_stage.h"
#include "faultline/numerics/random.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

// flow = 3 demand + 2 supply + shift, each with noise; demand steps every 2 s, supply swings.
Datasheet plant(double period = 0.01) {
  Datasheet sheet;
  sheet.rig = "plant";
  sheet.sample_period = period;
  const auto add = [&](const char* name, double maximum) {
    Channel c;
    c.name = name;
    c.unit = "V";
    c.maximum = maximum;
    sheet.channels.push_back(c);
  };
  add("demand", 1);
  add("supply", 2);
  add("flow", 20);
  return sheet;
}

using Words = std::map<std::string, std::string>;

StageSpec spec(std::map<std::string, double> numbers = {}, Words words = {{"flow_by", "demand, supply"}}) {
  numbers.insert({{"minimum", 5}, {"memory", 600}, {"learn", 300}, {"average", 0.5}, {"window", 20}});
  return {"histograms", "histogram", Settings("test", std::move(numbers), {}, std::move(words))};
}

class Plant {
 public:
  explicit Plant(double period = 0.01, std::uint64_t seed = 1) : period_(period), random_(seed) {}
  const Sample& next(double shift = 0, double supply_offset = 0) {
    if (sample_.sequence % static_cast<std::uint64_t>(std::lround(2 / period_)) == 0)
      demand_ = random_.uniform(0.05, 0.95);
    const double supply = 1 + supply_offset + swing * std::sin(0.1 * sample_.time);
    sample_.values = {demand_, supply, 3 * demand_ + 2 * supply + shift + 0.05 * random_.normal()};
    sample_.time += period_;
    ++sample_.sequence;
    return sample_;
  }
  void run(EstimatorStage& stage, double seconds, double shift = 0, double supply_offset = 0) {
    for (int k = 0; k < std::lround(seconds / period_); ++k) stage.process(next(shift, supply_offset), estimate);
  }
  double quantity(const std::string& name) const {
    for (const Quantity& q : estimate.quantities)
      if (q.name == name) return q.value;
    throw std::logic_error(name);
  }
  Estimate estimate;
  double swing = 0.5;  // of the supply

 private:
  double period_, demand_ = 0;
  Random random_;
  Sample sample_;
};

std::string refusal(const std::function<void()>& job) {
  try {
    job();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(HistogramStage, AShiftIsToldAndWhatExplainsItIsNot) {
  Plant plant_;
  EstimatorStage stage(plant(), spec({{"freeze", 0.5}}));
  plant_.run(stage, 299);
  EXPECT_EQ(plant_.quantity("judging"), 0);
  EXPECT_EQ(plant_.quantity("flow.average"), 0.5);
  plant_.run(stage, 100);
  EXPECT_EQ(plant_.quantity("judging"), 1);
  EXPECT_LT(plant_.quantity("flow.above"), 0.2);
  EXPECT_LT(plant_.quantity("flow.below"), 0.2);
  // The supply stays within what was learnt: 0.2 more moves the flow by 0.4.
  plant_.run(stage, 30, 0, 0.2);
  EXPECT_LT(plant_.quantity("flow.above"), 0.25);
  plant_.run(stage, 60, 0.8);
  EXPECT_GT(plant_.quantity("flow.above"), 0.8);
  EXPECT_GT(plant_.quantity("flow.average"), 1);
  plant_.run(stage, 60, -0.8);
  EXPECT_GT(plant_.quantity("flow.below"), 0.9);
  EXPECT_LT(plant_.quantity("flow.above"), 0.06);
  // Frozen: ten minutes of it are not learnt.
  plant_.run(stage, 600, -0.8);
  EXPECT_GT(plant_.quantity("flow.below"), 0.9);
}

TEST(HistogramStage, ALevelTellsWhatStaysWithinTheLimits) {
  Plant plant_;
  EstimatorStage stage(plant(), spec({{"freeze", 0.5}}));
  plant_.run(stage, 500);
  EXPECT_NEAR(plant_.quantity("flow.level"), 0.5, 0.1);
  plant_.run(stage, 60, 0.25);
  EXPECT_GT(plant_.quantity("flow.level"), 0.65);
  EXPECT_LT(plant_.quantity("flow.above"), 0.4);
  plant_.run(stage, 100, -0.25);
  EXPECT_LT(plant_.quantity("flow.level"), 0.35);
}

TEST(HistogramStage, WithoutFreezingAShiftBecomesNormal) {
  Plant plant_;
  EstimatorStage stage(plant(), spec({{"memory", 20}}));
  plant_.run(stage, 400);
  plant_.run(stage, 2000, 0.8);
  EXPECT_LT(plant_.quantity("flow.above"), 0.25);
}

TEST(HistogramStage, NothingIsFrozenWhileACommonCauseIsElsewhere) {
  // The supply goes where it never was and stays; the flow that only the demand explains goes with it.
  const auto after = [](Words words) {
    words.insert({{"flow_by", "demand"}, {"supply_by", "demand"}});
    Plant plant_;
    plant_.swing = 0.1;
    EstimatorStage stage(plant(), spec({{"freeze", 0.6}}, words));
    plant_.run(stage, 400);
    plant_.run(stage, 40, 0, 0.7);
    EXPECT_GT(plant_.quantity("supply.above"), 0.6);
    plant_.run(stage, 2000, 0, 0.7);
    return plant_.quantity("flow.above");
  };
  EXPECT_GT(after({}), 0.6);
  EXPECT_LT(after({{"common", "supply"}}), 0.25);
  EXPECT_NE(refusal([] {
              EstimatorStage(plant(), spec({}, {{"flow_by", "demand"}, {"common", "supply"}}));
            }).find("'common' names 'supply', which is not observed"),
            std::string::npos);
}

TEST(HistogramStage, BadValuesAreLeftOut) {
  Plant a, b;
  EstimatorStage stage(plant(), spec()), other(plant(), spec());
  a.run(stage, 330);
  b.run(other, 330);
  for (const std::size_t channel : {std::size_t{0}, std::size_t{2}})
    for (const double bad : {std::nan(""), 1e30, -5.0}) {
      Sample sample = a.next();
      b.next();
      sample.values[channel] = bad;
      stage.process(sample, a.estimate);
      EXPECT_EQ(stage.histograms()[0].bin, -1);
    }
  a.run(stage, 10);
  b.run(other, 10);
  EXPECT_NEAR(a.quantity("flow.average"), b.quantity("flow.average"), 0.02);
  EXPECT_EQ(stage.histograms()[0].sections, 32);
}

TEST(HistogramStage, SecondsAreSecondsAtEveryRate) {
  Plant slow(0.1);
  EstimatorStage own(plant(0.1), spec()), thinned(plant(0.05), spec({{"every", 0.1}}));
  Estimate estimate;
  for (int k = 0; k < 6000; ++k) {
    Sample sample = slow.next();
    own.process(sample, slow.estimate);
    thinned.process(sample, estimate);
    sample.time += 0.05;
    ++sample.sequence;
    sample.values[2] = 19;  // a sample between those that count
    thinned.process(sample, estimate);
  }
  const HistogramView a = own.histograms()[0], b = thinned.histograms()[0];
  EXPECT_EQ(a.axes[0].bins, 8);
  int alike = 0;
  for (std::size_t i = 0; i < a.mean.size(); ++i) alike += a.mean[i] < 18 && std::abs(a.mean[i] - b.mean[i]) < 1e-9;
  EXPECT_GE(alike, 20);
}

TEST(HistogramStage, ADriftIsFollowedToTheEndOfTheRange) {
  for (const char* arithmetic : {"floating", "integer"}) {
    Plant plant_(0.1);
    EstimatorStage stage(plant(0.1), spec({{"freeze", 0.3}, {"horizon", 300}},
                                          {{"flow_by", "demand, supply"}, {"arithmetic", arithmetic}}));
    plant_.run(stage, 900);
    EXPECT_GT(plant_.quantity("flow.saturation"), 3000);
    // 20 less 5.85 at the highest operating point are left (a little more: limits hold 90 %), at 0.007 a second; that
    // it may go faster later is counted in, and half of the samples lie too near to a step.
    double shift = 0;
    for (int k = 0; k < 900; ++k) plant_.run(stage, 1, shift += 0.007);
    const double left = (20 - 5.85 - shift) / 0.007;
    EXPECT_NEAR(plant_.quantity("flow.saturation"), left, 0.35 * left);
    EXPECT_LT(plant_.quantity("flow.saturation_low"), left);
    EXPECT_GT(plant_.quantity("flow.saturation_high"), 0.85 * left);  // the limit lies above 5.85
  }
}

// For 0.3 s after each step of the demand the flow overshoots, more and more; where it settles it does not drift.
TEST(HistogramStage, WhatAStepLeavesBehindIsNoDrift) {
  for (const bool settles : {true, false}) {
    Plant plant_(0.1);
    EstimatorStage stage(plant(0.1), spec({{"freeze", 1}, {"horizon", 300}}));
    plant_.run(stage, 900);
    for (int k = 0; k < 3000; ++k) stage.process(plant_.next(!settles || k % 20 < 3 ? 0.003 * k : 0), plant_.estimate);
    EXPECT_EQ(plant_.quantity("flow.saturation") > 1e8, settles);
  }
}

TEST(HistogramStage, IntegersTellTheSame) {
  Plant a, b;
  EstimatorStage floating(plant(), spec()),
      integer(plant(), spec({}, {{"flow_by", "demand, supply"}, {"arithmetic", "integer"}}));
  a.run(floating, 400);
  b.run(integer, 400);
  a.run(floating, 10, 0.4);
  b.run(integer, 10, 0.4);
  EXPECT_NEAR(a.quantity("flow.average"), b.quantity("flow.average"), 0.01);
  EXPECT_NEAR(a.quantity("flow.above"), b.quantity("flow.above"), 0.01);
  const HistogramView x = floating.histograms()[0], y = integer.histograms()[0];
  int ready = 0;
  for (std::size_t i = 0; i < x.mean.size(); ++i) {
    if (std::isnan(x.mean[i])) continue;
    ++ready;
    EXPECT_NEAR(x.mean[i], y.mean[i], x.width[i]);
    EXPECT_NEAR(x.low[i], y.low[i], x.width[i]);
    EXPECT_NEAR(x.high[i], y.high[i], x.width[i]);
  }
  EXPECT_GE(ready, 20);
}

TEST(HistogramStage, AViewHoldsWhatWasLearnt) {
  Plant plant_;
  EstimatorStage stage(plant(), spec({}, {{"flow_by", "demand"}, {"supply_by", "none"}}));
  plant_.run(stage, 320);
  const std::vector<HistogramView> views = stage.histograms();
  ASSERT_EQ(views.size(), 2u);
  EXPECT_EQ(views[0].variable, "supply");
  EXPECT_TRUE(views[0].axes.empty());
  ASSERT_EQ(views[0].mean.size(), 1u);
  EXPECT_NEAR(views[0].mean[0], 1, 0.03);
  EXPECT_NEAR(views[0].high[0], 1.49, 0.03);
  ASSERT_EQ(views[1].axes.size(), 1u);
  EXPECT_EQ(views[1].axes[0].variable, "demand");
  EXPECT_EQ(views[1].axes[0].low, 0);
  EXPECT_EQ(views[1].axes[0].high, 1);
  ASSERT_EQ(views[1].counts.size(), 8u * 32);
  for (int b = 0; b < 8; ++b) {
    const double* counts = &views[1].counts[static_cast<std::size_t>(b) * 32];
    double sum = 0, mean = 0;
    for (int i = 0; i < 32; ++i) {
      sum += counts[i];
      mean += counts[i] * (views[1].start[b] + (i + 0.5) * views[1].width[b]);
    }
    EXPECT_EQ(sum, views[1].population[b]);
    EXPECT_NEAR(mean / sum, views[1].mean[b], views[1].width[b]) << b;  // of up to an eighth of samples ago
  }
}

TEST(HistogramStage, IsKeptAndRestored) {
  const std::string file = ::testing::TempDir() + "histogram_stage.reference";
  std::filesystem::remove(file);
  Plant plant_;
  EstimatorStage stage(plant(), spec());
  EXPECT_FALSE(stage.reference());
  plant_.run(stage, 200);
  EstimatorStage halfway(plant(), spec());  // goes on learning
  halfway.restore(*stage.reference());
  Plant on(0.01, 8);
  on.run(halfway, 99);
  EXPECT_EQ(on.quantity("judging"), 0);
  on.run(halfway, 2);
  EXPECT_EQ(on.quantity("judging"), 1);
  plant_.run(stage, 200);
  References kept{"plant", "", {{"other", {"band", 1, {"level"}, {3}}}, {stage.name(), *stage.reference()}}};
  write_references(kept, file);

  EstimatorStage again(plant(), spec());
  restore_stage(read_references(file, "plant"), again);
  Plant later(0.01, 9);
  later.run(again, 60, 0.8);
  EXPECT_EQ(later.quantity("judging"), 1);
  EXPECT_GT(later.quantity("flow.above"), 0.8);
  EstimatorStage same(plant(), spec());
  restore_stage(read_references(file, "plant"), same);
  const HistogramView a = stage.histograms()[0], b = same.histograms()[0];
  EXPECT_EQ(a.counts, b.counts);
  EXPECT_EQ(a.population, b.population);

  // Kept again beside what others have there.
  update_references({"plant", "", {{stage.name(), *again.reference()}}}, file);
  const References both = read_references(file, "plant");
  ASSERT_EQ(both.stages.size(), 2u);
  EXPECT_EQ(both.stages[1].reference.numbers, std::vector<double>{3});

  // Refused: damaged, of other settings, of other explanatory channels; the damaged file is kept.
  std::stringstream text;
  text << std::ifstream(file).rdbuf();
  std::string damaged = text.str();
  damaged[damaged.size() / 2] ^= 1;
  std::ofstream(file) << damaged;
  EXPECT_NE(refusal([&] { read_references(file, "plant"); }).find("damaged"), std::string::npos);
  EXPECT_NE(refusal([&] {
              update_references({"plant", "", {{"x", *again.reference()}}}, file);
            }).find("damaged"),
            std::string::npos);
  std::stringstream after;
  after << std::ifstream(file).rdbuf();
  EXPECT_EQ(after.str(), damaged);
  EstimatorStage coarse(plant(), spec({{"bins", 4}})), swapped(plant(), spec({}, {{"flow_by", "supply, demand"}}));
  EXPECT_NE(refusal([&] { restore_stage(both, coarse); }).find("learn it anew"), std::string::npos);
  EXPECT_NE(refusal([&] { restore_stage(both, swapped); }).find("learn it anew"), std::string::npos);
  References odd = kept;
  odd.stages[1].reference.numbers.back() = -3;
  EXPECT_NE(refusal([&] { restore_stage(odd, same); }).find("no histogram"), std::string::npos);
  EXPECT_EQ(same.histograms()[0].counts, b.counts);
  std::filesystem::remove(file);
}

TEST(HistogramStage, AGapForgetsNothing) {
  Plant plant_;
  EstimatorStage stage(plant(), spec());
  plant_.run(stage, 400);
  const HistogramView before = stage.histograms()[0];
  stage.reset();
  plant_.run(stage, 0.01);
  EXPECT_TRUE(plant_.estimate.restarted);
  EXPECT_EQ(plant_.quantity("judging"), 1);
  EXPECT_EQ(stage.histograms()[0].counts, before.counts);
  EXPECT_EQ(plant_.quantity("flow.average"), 0.5);
}

TEST(HistogramStage, AStepAllocatesNothing) {
  Plant plant_;
  EstimatorStage stage(plant(), spec());
  plant_.run(stage, 320);
  const std::uint64_t before = allocations();
  plant_.run(stage, 20);
  // The plant's own samples are vectors of one allocation each.
  EXPECT_LE(allocations() - before, 2000u);
}

TEST(HistogramStage, BadSettingsAreNamed) {
  const auto said = [](std::map<std::string, double> numbers, Words words = {{"flow_by", "demand"}}) {
    return refusal([&] { EstimatorStage(plant(), spec(std::move(numbers), std::move(words))); });
  };
  EXPECT_NE(said({}, {}).find("no channel is observed"), std::string::npos);
  EXPECT_NE(said({}, {{"flow_by", "wind"}}).find("wind"), std::string::npos);
  EXPECT_NE(said({}, {{"flow_by", "demand, supply, flow"}}).find("one, two or none"), std::string::npos);
  EXPECT_NE(said({}, {{"flow_by", "demand"}, {"wind_by", "demand"}}).find("wind_by"), std::string::npos);
  EXPECT_NE(said({}, {{"flow_by", "demand"}, {"arithmetic", "roman"}}).find("'roman'"), std::string::npos);
  EXPECT_NE(said({{"memory", 6000}}).find("'memory' is 6000"), std::string::npos);  // 65535 samples
  EXPECT_NE(said({{"coverage", 1.5}}).find("'coverage'"), std::string::npos);
}

}  // namespace
}  // namespace faultline
