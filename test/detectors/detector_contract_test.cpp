// The contract of every detector type that is registered: a complete reset, finite numbers on extreme estimates, time
// that runs backwards or stands still, silence on a rig where nothing is the matter, and settings that are refused.
#include <gtest/gtest.h>

#include <limits>
#include <map>

#include "detectors/estimates.h"
#include "faultline/detectors/persistence.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

std::vector<std::string> types() {
  std::vector<std::string> names;
  for (const DetectorType& type : registry<DetectorType>().all()) names.push_back(type.name);
  return names;
}

// Detectors that the servo actuator does not use, on signals of sigma one.
const std::map<std::string, Settings>& further() {
  static const std::map<std::string, Settings> all = {
      {"cusum",
       {"test",
        {{"change", 8}, {"threshold_changes", 3}, {"reference", 0}, {"minimum_time", 0.5}, {"release_time", 3}},
        {},
        {{"quantity", "shifting"}}}},
      {"redline",
       {"test",
        {{"margin", 10}, {"expected", 0}, {"minimum_time", 0.5}, {"release_time", 3}},
        {},
        {{"quantity", "shifting"}}}},
      {"innovation_test",
       {"test",
        {{"window", 100},
         {"noise", 1},
         {"period", 1e-3},
         {"false_alarms_per_hour", 1e-3},
         {"minimum_time", 0.5},
         {"release_time", 3}},
        {},
        {{"quantity", "shifting"}}}},
      {"nominal", {"test", {{"sigmas", 4}, {"learn", 0.5}}, {}, {{"quantity", "ram_area"}}}},
      {"frozen", {"test", {{"count", 10}, {"release_time", 3}}, {}, {{"quantity", "dying"}}}},
      {"ripple",
       {"test",
        {{"limit", 8}, {"swings", 4}, {"average", 0.6}, {"noise", 1}, {"release_time", 3}},
        {},
        {{"quantity", "swinging"}}}},
      {"noisy",
       {"test",
        {{"noise", 1}, {"limit", 3}, {"window", 10}, {"minimum_time", 0.5}, {"release_time", 3}},
        {},
        {{"quantity", "roughening"}}}},
  };
  return all;
}

// The first stage of the sheet that uses the type.
StageSpec stage(const std::string& type) {
  const auto found = further().find(type);
  if (found != further().end()) return {type, type, found->second};
  for (const StageSpec& spec : servo().detectors)
    if (spec.type == type) return spec;
  throw InputError("the servo actuator's sheet has no detector of type " + type);
}

bool same(const Detection& a, const Detection& b) {
  return a.active == b.active && a.since == b.since && a.has_size == b.has_size && a.size == b.size && a.low == b.low &&
         a.high == b.high && a.confidence == b.confidence;
}

bool sound(const Detection& d) {
  return std::isfinite(d.size) && std::isfinite(d.low) && std::isfinite(d.high) && std::isfinite(d.confidence) &&
         d.confidence >= 0 && d.confidence <= 1 && std::isfinite(d.since) &&
         (!d.has_size || (d.low <= d.size && d.size <= d.high));
}

// Judges what is there from the start, once.
bool of_the_start(const std::string& type) { return type == "nominal"; }

class EveryDetector : public ::testing::TestWithParam<std::string> {
 protected:
  std::unique_ptr<Detector> detector_ = make_detector(servo(), stage(GetParam()));
  Detection detection_;
};

TEST_P(EveryDetector, IsSilentAtRest) {
  for (int k = 0; k < 60000; ++k) {
    detector_->process(quiet(k * 1e-3), detection_);
    ASSERT_FALSE(detection_.active) << k;
    ASSERT_TRUE(sound(detection_)) << k;
  }
}

TEST_P(EveryDetector, SpeaksWhenEverythingIsOff) {
  int first = -1;
  const int off = of_the_start(GetParam()) ? 0 : 10000;
  for (int k = 0; k < 60000 && first < 0; ++k) {
    detector_->process(k < off ? quiet(k * 1e-3) : loud(k * 1e-3), detection_);
    ASSERT_TRUE(sound(detection_)) << k;
    if (detection_.active) first = k;
  }
  ASSERT_GT(first, off);
  EXPECT_LT(first, off + 12000);
  EXPECT_GE(detection_.since, (off - 1) * 1e-3);
  EXPECT_LE(detection_.since, first * 1e-3);
  EXPECT_GT(detection_.confidence, 0.5);
  if (of_the_start(GetParam())) return;  // and stays
  // And ends again.
  int last = first;
  for (int k = first; k < first + 90000 && detection_.active; ++k) {
    detector_->process(quiet(k * 1e-3), detection_);
    last = k;
  }
  EXPECT_FALSE(detection_.active);
  EXPECT_GT(last, first + 2000);  // release_time
}

TEST_P(EveryDetector, ResetIsComplete) {
  std::vector<Detection> first;
  for (int pass = 0; pass < 2; ++pass) {
    detector_->reset();
    Detection detection;
    for (int k = 0; k < 30000; ++k) {
      detector_->process(k % 20000 < 8000 ? quiet(k * 1e-3) : loud(k * 1e-3), detection);
      if (pass == 0)
        first.push_back(detection);
      else
        ASSERT_TRUE(same(detection, first[static_cast<std::size_t>(k)])) << k;
    }
  }
}

// After a gap in the data; but what a detector has judged of the rig, once and for all, stays.
TEST_P(EveryDetector, RestartOfTheEstimatorEndsWhatItSees) {
  for (int k = 0; k < 30000; ++k) detector_->process(loud(k * 1e-3), detection_);
  EXPECT_TRUE(detection_.active);
  if (GetParam() == "nominal") {
    Estimate estimate = quiet(100);
    estimate.restarted = true;
    detector_->process(estimate, detection_);
    EXPECT_TRUE(detection_.active);
    return;
  }
  auto fresh = make_detector(servo(), stage(GetParam()));
  Detection expected;
  for (int k = 0; k < 10000; ++k) {
    Estimate estimate = quiet(100 + k * 1e-3);
    estimate.restarted = k == 0;
    detector_->process(estimate, detection_);
    fresh->process(estimate, expected);
    ASSERT_TRUE(same(detection_, expected)) << k;
  }
}

TEST_P(EveryDetector, StaysFiniteOnExtremes) {
  for (const double value : {0.0, 1e-300, 1e12, -1e12, 1e30, -1e30}) {
    detector_->reset();
    for (int k = 0; k < 5000; ++k) {
      Estimate estimate = quiet(k * 1e-3);
      for (Quantity& q : estimate.quantities) q.value = value, q.std = std::abs(value);
      estimate.quantities[5].value = std::abs(value);  // a square root
      estimate.normalised_innovation = std::abs(value);
      estimate.observed = k % 3;
      detector_->process(estimate, detection_);
      ASSERT_TRUE(sound(detection_)) << value << " " << k;
    }
  }
}

TEST_P(EveryDetector, TimeMayStandStillOrRunBack) {
  for (int k = 0; k < 5000; ++k) detector_->process(quiet(50 + k * 1e-3), detection_);
  for (const double time : {55.0, 55.0, 54.0, 10.0, 10.0, 0.0, -5.0}) {
    detector_->process(loud(time), detection_);
    EXPECT_TRUE(sound(detection_)) << time;
    EXPECT_FALSE(detection_.active) << time;  // a handful of samples proves nothing
  }
}

TEST_P(EveryDetector, RefusesUnknownAndMissingSettings) {
  StageSpec spec = stage(GetParam());
  spec.settings = Settings("test", {}, {}, {});
  EXPECT_THROW(make_detector(servo(), spec), InputError);
}

INSTANTIATE_TEST_SUITE_P(Types, EveryDetector, ::testing::ValuesIn(types()));

struct SeesTheDatasheet : Detector {
  SeesTheDatasheet(const Datasheet& sheet, const StageSpec& spec) : name(sheet.rig + " " + spec.name) {}
  void reset() override {}
  void process(const Estimate&, Detection&) override {}
  std::string name;
};

TEST(Detector, MaySeeTheDatasheet) {
  const auto made = make_detector_of<SeesTheDatasheet>(servo(), stage("band"));
  EXPECT_EQ(static_cast<SeesTheDatasheet&>(*made).name, "servo_actuator pressure_redundancy");
}

TEST(Detector, UnknownTypeAndQuantityAreNamed) {
  StageSpec spec = stage("band");
  spec.type = "oracle";
  try {
    make_detector(servo(), spec);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("consistency"), std::string::npos);
  }
  try {
    find_quantity(quiet(0), "colour");
    FAIL();
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("colour"), std::string::npos);
    EXPECT_NE(std::string(e.what()).find("leak_coefficient"), std::string::npos);
  }
}

TEST(Persistence, NeedsItsTimeAndKeepsItsBeginning) {
  Persistence persistence(1, 2);
  EXPECT_FALSE(persistence.update(0, false));
  EXPECT_FALSE(persistence.update(10, true));
  EXPECT_FALSE(persistence.update(10.9, true));
  EXPECT_TRUE(persistence.update(11, true));
  EXPECT_EQ(persistence.since(), 10);
  EXPECT_TRUE(persistence.update(12.9, false));
  EXPECT_TRUE(persistence.update(12.95, true));
  EXPECT_EQ(persistence.since(), 10);
  EXPECT_TRUE(persistence.update(14.9, false));
  EXPECT_FALSE(persistence.update(15, false));
  EXPECT_FALSE(persistence.update(20, true));
  EXPECT_FALSE(persistence.update(20.5, false));  // too short to have counted: begins anew
  EXPECT_FALSE(persistence.update(21.2, true));
  EXPECT_EQ(persistence.since(), 21.2);
}

}  // namespace
}  // namespace faultline
