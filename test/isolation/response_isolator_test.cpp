// The isolator `response` on rankings made by hand: what it names, of which size, with which rivals, and when it says
// nothing.
#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "faultline/isolation/isolator.h"
#include "faultline/numerics/quantiles.h"
#include "faultline/signal/error.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

RankedHypothesis cause(const std::string& effect, const std::string& port, std::uint32_t order, double evidence) {
  RankedHypothesis h;
  h.effect = effect;
  h.port = port;
  h.kind = AlarmKind::fault;
  h.size_name = "coefficient";
  h.size_unit = "m^3/(s sqrt(Pa))";
  h.order = order;
  h.none = 0;
  h.full = 2e-8;
  h.amplitude = 0.5;
  h.std = 0.1;
  h.evidence = evidence;
  return h;
}

const char* const kSeal = "flow.chamber_a_chamber_b";
const char* const kOutside = "flow.chamber_a_ambient";

class ResponseIsolation : public ::testing::Test {
 protected:
  const Finding& hear(const std::vector<RankedHypothesis>& first, const std::vector<RankedHypothesis>& second = {}) {
    auto ranking = std::make_shared<Ranking>();
    ranking->since = 7;
    ranking->judged_until = 10 + heard_;
    ranking->threshold = 15;
    ranking->evidence = first.empty() ? left_ : first.front().evidence;
    ranking->first = first;
    ranking->second = second;
    ranking->doubt = doubt_;
    ranking->stuck = stuck_;
    Estimate estimate;
    estimate.time = 11 + heard_;
    estimate.channel_status.assign(servo().channels.size(), ChannelStatus::good);
    estimate.ranking = ranking;
    heard_ += 2;
    isolator_->process(estimate, {}, finding_);
    return finding_;
  }

  double heard_ = 0, left_ = 2;
  std::string doubt_, stuck_;
  Finding finding_;
  std::unique_ptr<Isolator> isolator_ = make_isolator(servo(), servo().isolators[0]);
};

TEST_F(ResponseIsolation, NamesTheBestWithItsSize) {
  EXPECT_FALSE(hear({}).active);
  EXPECT_EQ(isolator_->judged_until(), 10);
  const Finding& f = hear({cause("orifice_leakage", kSeal, 3, 100), cause("laminar_leakage", kOutside, 8, 40)});
  ASSERT_TRUE(f.active);
  EXPECT_EQ(f.effect, "orifice_leakage");
  EXPECT_EQ(f.port, kSeal);
  EXPECT_EQ(f.since, 7);
  EXPECT_TRUE(f.equivalent.empty());
  EXPECT_DOUBLE_EQ(f.size, 1e-8);
  const double std = std::hypot(0.7 * 0.1, 0.04 * 0.5);  // std_factor and model_error of the datasheet
  EXPECT_NEAR(f.low, 2e-8 * (0.5 - kNinetyPercentSigmas * std), 1e-20);
  EXPECT_NEAR(f.high, 2e-8 * (0.5 + kNinetyPercentSigmas * std), 1e-20);
  EXPECT_NEAR(f.confidence, 1, 1e-12);
  EXPECT_EQ(isolator_->judged_until(), 12);
  EXPECT_FALSE(hear({}).active);
}

TEST_F(ResponseIsolation, WhatIsNotConfirmedIsUndecided) {
  hear({});
  EXPECT_TRUE(std::isnan(isolator_->undecided_since()));
  left_ = 15;  // the threshold, without a cause
  hear({});
  EXPECT_EQ(isolator_->undecided_since(), 12);
  hear({cause("orifice_leakage", kSeal, 3, 100)});
  EXPECT_TRUE(std::isnan(isolator_->undecided_since()));
}

TEST_F(ResponseIsolation, MoreThanAFaultTakesAndNoCauseIsTold) {
  left_ = 40;
  const Finding& f = hear({});
  ASSERT_TRUE(f.active);
  EXPECT_EQ(f.kind, AlarmKind::unknown);
  EXPECT_TRUE(f.effect.empty());
  EXPECT_TRUE(f.equivalent.empty());
  EXPECT_FALSE(f.has_size);
  EXPECT_EQ(f.since, 7);
  EXPECT_EQ(hear({cause("orifice_leakage", kSeal, 3, 100)}).effect, "orifice_leakage");
  left_ = 2;
  EXPECT_FALSE(hear({}).active);
}

TEST_F(ResponseIsolation, RivalsWithinTheMarginAreEquivalent) {
  // 2 % of the evidence, at least 3: 4.
  const Finding& f = hear({cause("orifice_leakage", kSeal, 3, 200), cause("laminar_leakage", kOutside, 8, 196.5),
                           cause("viscous_friction", "force.piston", 1, 195.5)});
  EXPECT_EQ(f.equivalent, std::vector<std::string>{std::string("laminar_leakage@") + kOutside});
  EXPECT_NEAR(f.confidence, 0.5, 1e-12);  // two that cannot be told apart
}

TEST_F(ResponseIsolation, TwinsAtOnePlaceGoByTheFirstOfTheDatasheet) {
  const Finding& f = hear({cause("laminar_leakage", kSeal, 4, 100), cause("orifice_leakage", kSeal, 3, 99)});
  EXPECT_EQ(f.effect, "orifice_leakage");
  EXPECT_EQ(f.equivalent, std::vector<std::string>{std::string("laminar_leakage@") + kSeal});
  EXPECT_NEAR(f.confidence, 1, 1e-12);  // of the place
}

TEST_F(ResponseIsolation, ANameThatExplainsAsWellStays) {
  EXPECT_EQ(hear({cause("orifice_leakage", kSeal, 3, 100), cause("laminar_leakage", kOutside, 1, 98)}).effect,
            "orifice_leakage");
  EXPECT_EQ(hear({cause("laminar_leakage", kOutside, 1, 101), cause("orifice_leakage", kSeal, 3, 99)}).effect,
            "orifice_leakage");
  EXPECT_EQ(hear({cause("laminar_leakage", kOutside, 1, 120), cause("orifice_leakage", kSeal, 3, 99)}).effect,
            "laminar_leakage");
}

TEST_F(ResponseIsolation, TooManyRivalsAreUnknown) {
  std::vector<RankedHypothesis> many;
  for (std::uint32_t k = 0; k < 8; ++k) many.push_back(cause("effect_" + std::to_string(k), kSeal, k, 100 - 0.1 * k));
  const Finding& f = hear(many);
  EXPECT_TRUE(f.active);
  EXPECT_EQ(f.kind, AlarmKind::unknown);
  EXPECT_EQ(f.effect, "");
  EXPECT_FALSE(f.has_size);
  EXPECT_EQ(f.equivalent.size(), 8u);  // all of them are candidates, the likeliest first
  EXPECT_EQ(f.equivalent.front(), std::string("effect_0@") + kSeal);
}

TEST_F(ResponseIsolation, WhatRigsInGoodOrderHaveIsNotToldAndExplainsTheRest) {
  // least_share: of 5e-8, so 1e-8.
  const std::map<std::string, double> numbers = {
      {"rival", 0.02}, {"rival_least", 3}, {"most_rivals", 6}, {"model_error", 0.04}, {"least_share", 0.2}};
  isolator_ = make_isolator(servo(), {"fault", "response", Settings("test", numbers, {}, {})});
  RankedHypothesis leak = cause("orifice_leakage", kSeal, 3, 100);
  const auto heard = [&](double size) {
    leak.amplitude = size / leak.full;
    leak.evidence += 1;
    const Finding& f = hear({leak});
    EXPECT_EQ(f.active, f.too_small.empty());
    return f.active;
  };
  EXPECT_FALSE(heard(0.9e-8));
  EXPECT_EQ(hear({leak}).too_small, "orifice_leakage@" + std::string(kSeal) + ", 9e-09 m^3/(s sqrt(Pa))");
  RankedHypothesis scale = cause("scale", "sensor.velocity", 1, 100);
  scale.none = 1;
  scale.full = 1.002;
  scale.amplitude = 0.1;
  scale.size_name = "factor";
  scale.size_unit = "1";
  EXPECT_EQ(hear({scale}).too_small, "scale@sensor.velocity, 1.0002");
  leak.evidence += 1;
  hear({leak});
  EXPECT_TRUE(isolator_->finds_all_explained());
  EXPECT_TRUE(heard(1.1e-8));
  EXPECT_FALSE(isolator_->finds_all_explained());
  EXPECT_TRUE(heard(0.6e-8));  // what is told stays down to half of that
  EXPECT_FALSE(heard(0.4e-8));
}

TEST_F(ResponseIsolation, OneStretchThatLeavesMoreDoesNotMakeAGoodRigABadOne) {
  left_ = 10;  // of a threshold of 15: more than 0.6 of it
  hear({});
  EXPECT_FALSE(isolator_->finds_all_explained());  // not even once
  left_ = 2;
  hear({});
  EXPECT_TRUE(isolator_->finds_all_explained());
  left_ = 10;
  // Of three stretches that are looked at together one shows in six judgements.
  for (int judgement = 1; judgement <= 8; ++judgement) {
    hear({});
    EXPECT_EQ(isolator_->finds_all_explained(), judgement < 7) << judgement;
  }
  left_ = 2;
  hear({});
  EXPECT_TRUE(isolator_->finds_all_explained());
  doubt_ = "swapped";
  hear({});
  EXPECT_FALSE(isolator_->finds_all_explained());
}

TEST_F(ResponseIsolation, ASizeAtItsBoundIsUnknown) {
  RankedHypothesis largest = cause("orifice_leakage", kSeal, 3, 100);
  largest.amplitude = 2.5;  // 5e-8, where the datasheet ends
  const Finding& f = hear({largest});
  EXPECT_TRUE(f.active);
  EXPECT_EQ(f.kind, AlarmKind::unknown);
  EXPECT_EQ(f.effect + f.port, "");
  EXPECT_FALSE(f.has_size);
  EXPECT_EQ(f.equivalent, std::vector<std::string>{std::string("orifice_leakage@") + kSeal});
  EXPECT_NE(f.text.find("5e-08 m^3/(s sqrt(Pa))"), std::string::npos) << f.text;
  largest.amplitude = 2.4;
  largest.evidence = 101;
  EXPECT_EQ(hear({largest}).effect, "orifice_leakage");
}

TEST_F(ResponseIsolation, AChannelThatIsNotWhatItIsCalledComesBeforeAnyFault) {
  doubt_ = "position: its sign is turned";
  const Finding& f = hear({cause("orifice_leakage", kSeal, 3, 100)});
  EXPECT_TRUE(f.active);
  EXPECT_EQ(f.kind, AlarmKind::data);
  EXPECT_EQ(f.effect + f.port, "");
  EXPECT_EQ(f.text, doubt_);
  EXPECT_FALSE(f.has_size);
  stuck_ = "command.valve_command";
  EXPECT_EQ(hear({cause("orifice_leakage", kSeal, 3, 101)}).kind, AlarmKind::fault);
}

TEST_F(ResponseIsolation, AStuckTransducerIsNamed) {
  doubt_ = "position: this transducer is stuck";
  stuck_ = "sensor.position";
  const Finding& f = hear({cause("orifice_leakage", kSeal, 3, 100)});
  ASSERT_TRUE(f.active);
  EXPECT_EQ(f.kind, AlarmKind::sensor);
  EXPECT_EQ(f.effect, "stuck");
  EXPECT_EQ(f.port, stuck_);
  EXPECT_EQ(f.text, doubt_);
  EXPECT_FALSE(f.has_size);
}

TEST_F(ResponseIsolation, TheSecondIsConfirmedFirst) {
  isolator_ = make_isolator(servo(), servo().isolators[1]);  // place 2, confirm 2
  const std::vector<RankedHypothesis> first = {cause("orifice_leakage", kSeal, 3, 100)};
  EXPECT_FALSE(hear(first).active);
  RankedHypothesis friction = cause("viscous_friction", "force.piston", 1, 50);
  friction.full = 600;  // N s/m, of which half is there
  EXPECT_FALSE(hear(first, {friction}).active);
  friction.evidence = 51;
  EXPECT_TRUE(hear(first, {friction}).active);
  EXPECT_EQ(finding_.effect, "viscous_friction");
  EXPECT_FALSE(isolator_->overrules());
  EXPECT_TRUE(make_isolator(servo(), servo().isolators[0])->overrules());
}

// What the first lacks is made up for by another, which is no fault.
TEST_F(ResponseIsolation, BesideACauseAtItsBoundThereIsNoSecond) {
  isolator_ = make_isolator(servo(), servo().isolators[1]);
  RankedHypothesis first = cause("orifice_leakage", kSeal, 3, 100);
  RankedHypothesis friction = cause("viscous_friction", "force.piston", 1, 50);
  friction.full = 600;
  hear({first}, {friction});
  EXPECT_TRUE(hear({first}, {friction}).active);
  const Port& seal = servo().port(kSeal);
  const auto leak = std::find_if(seal.effects.begin(), seal.effects.end(),
                                 [](const FittingEffect& e) { return e.effect == "orifice_leakage"; });
  first.amplitude = leak->bounds.at("coefficient").maximum / first.full;
  EXPECT_FALSE(hear({first}, {friction}).active);
}

TEST_F(ResponseIsolation, AStageThatRanksNothingIsRefused) {
  Estimate estimate;
  isolator_->process(estimate, {}, finding_);  // it has not spoken yet
  EXPECT_FALSE(finding_.active);
  estimate.channel_status.assign(servo().channels.size(), ChannelStatus::good);
  try {
    isolator_->process(estimate, {}, finding_);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("stages.yaml:"), std::string::npos);
    EXPECT_NE(std::string(error.what()).find("ranking"), std::string::npos);
  }
}

TEST(RankedHypothesis, IntervalsOfSizesThatGrowAndThatFall) {
  RankedHypothesis h = cause("orifice_leakage", kSeal, 0, 1);
  EXPECT_NEAR(h.sizes(0.2).low, 2e-8 * (0.5 - 0.2 * kNinetyPercentSigmas), 1e-20);
  EXPECT_EQ(h.sizes(1).low, 0);  // never beyond what the datasheet allows
  EXPECT_NEAR(h.sizes(1).high, 2e-8 * (0.5 + kNinetyPercentSigmas), 1e-20);
  h.none = std::numeric_limits<double>::infinity();  // a limit: the larger the amplitude, the lower it is
  h.full = 0.3;
  EXPECT_DOUBLE_EQ(h.size(), 0.6);
  EXPECT_NEAR(h.sizes(0.1).low, 0.3 / (0.5 + 0.1 * kNinetyPercentSigmas), 1e-12);
  EXPECT_NEAR(h.sizes(0.1).high, 0.3 / (0.5 - 0.1 * kNinetyPercentSigmas), 1e-12);
  EXPECT_NEAR(h.sizes(1).high, 0.3 / 0.0005, 1e-9);
}

// The size of a drift is another one each time. The first comes of a stretch in which it began and says nothing.
TEST_F(ResponseIsolation, AnOffsetThatGrowsWithTimeIsADrift) {
  Datasheet drifting = servo();
  Port& port = *std::find_if(drifting.ports.begin(), drifting.ports.end(),
                             [](const Port& p) { return p.name == "sensor.chamber_a_pressure"; });
  port.effects.push_back({"drift", {{"rate", {-1e5, 1e5}}}});
  const auto tell = [&](const std::vector<double>& sizes) {
    isolator_ = make_isolator(drifting, drifting.isolators[0]);
    for (std::size_t i = 0; i < sizes.size(); ++i) {
      RankedHypothesis offset = cause("offset", port.name, 3, 100 + static_cast<double>(i));
      offset.kind = AlarmKind::sensor;
      offset.size_name = "value";
      offset.size_unit = "Pa";
      offset.full = 1e5;
      offset.amplitude = sizes[i] / offset.full;
      RankedHypothesis scale = offset;
      scale.effect = "scale";
      scale.order = 4;
      hear({offset, scale});
    }
    return finding_;
  };
  const Finding drift = tell({20000, 60000, 100000, 140000, 180000});
  EXPECT_EQ(drift.effect, "drift");
  EXPECT_EQ(drift.port, port.name);
  EXPECT_EQ(drift.size_name, "rate");
  EXPECT_EQ(drift.size_unit, "Pa/s");
  EXPECT_NEAR(drift.size, 20000, 1e-6);  // every 2 s
  EXPECT_LT(drift.low, 20000);
  EXPECT_GT(drift.high, 20000);
  EXPECT_TRUE(drift.equivalent.empty());  // a scale does not grow
  const Finding step = tell({90000, 170000, 180000, 175000, 182000});
  EXPECT_EQ(step.effect, "offset");
  EXPECT_EQ(step.equivalent, std::vector<std::string>{"scale@" + port.name});
  // Beyond the largest offset it goes on to be one, though a scale follows it further.
  EXPECT_EQ(tell({100000, 150000, 200000, 250000, 300000}).effect, "drift");
  RankedHypothesis scale = cause("scale", port.name, 4, 200), offset = cause("offset", port.name, 3, 150);
  scale.size_name = "factor";
  scale.none = 1;
  scale.full = 1.1;
  scale.kind = offset.kind = AlarmKind::sensor;
  offset.size_name = "value";
  offset.full = 3e5;
  offset.amplitude = 1;
  EXPECT_EQ(hear({scale, offset}).effect, "drift");
  EXPECT_EQ(hear({cause("orifice_leakage", kSeal, 5, 300)}).effect, "orifice_leakage");
}

// However many effects explain it there.
TEST_F(ResponseIsolation, EachPlaceCountsByItsBest) {
  const Finding& f =
      hear({cause("orifice_leakage", kSeal, 3, 100), cause("laminar_leakage", kOutside, 8, 96),
            cause("orifice_leakage", kOutside, 9, 95.9), cause("viscous_friction", "force.piston", 1, 93)});
  EXPECT_NEAR(f.confidence, 1 / (1 + std::exp(-2.0) + std::exp(-3.5)), 1e-9);
}

}  // namespace
}  // namespace faultline
