// What the detectors say in numbers, on estimates made by hand.
#include <gtest/gtest.h>

#include "detectors/estimates.h"

namespace faultline {
namespace {

// As the sheet sets it, but for what the numbers below rest on.
std::unique_ptr<Detector> of_sheet(const std::string& name) {
  for (StageSpec spec : servo().detectors) {
    if (spec.name != name) continue;
    if (name == "internal_leak") {
      for (const auto& [key, value] : std::vector<std::pair<const char*, double>>{{"average", 2},
                                                                                  {"threshold", 2.5e-9},
                                                                                  {"known_std", 2e-9},
                                                                                  {"minimum_drive", 400},
                                                                                  {"model_error", 0.06},
                                                                                  {"model_floor", 2.5e-9},
                                                                                  {"motion_error", 0.02},
                                                                                  {"minimum_time", 1}})
        spec.settings.set(key, value);
    }
    return make_detector(servo(), spec);
  }
  return nullptr;
}

TEST(LeakDetector, SizeIsCoefficientTimesDrive) {
  const auto detector = of_sheet("internal_leak");
  Detection detection;
  double raised = 0;
  for (int k = 0; k < 60000; ++k) {
    Estimate estimate = quiet(k * 1e-3);
    if (k >= 20000) estimate.quantities[0].value = 1.5e-8;
    detector->process(estimate, detection);
    if (detection.active && raised == 0) raised = k * 1e-3;
  }
  EXPECT_EQ(detector->size_unit(), "m^3/s");
  EXPECT_NEAR(detection.size, 1.5e-8 * 800, 1e-7);
  // 90 % bounds: 1.6449 sqrt((6 % of it)^2 + (2.5e-9)^2) of coefficient either side.
  const double half = 1.6448536 * std::sqrt(std::pow(0.06 * 1.5e-8, 2) + 2.5e-9 * 2.5e-9) * 800;
  EXPECT_NEAR(detection.high - detection.size, half, 0.02 * half);
  EXPECT_NEAR(detection.size - detection.low, half, 0.02 * half);
  EXPECT_GT(detection.confidence, 0.99);
  // An average of 2 s weighted 0.8 crosses 2.5e-9 of 1.5e-8 after 0.46 s; then 1 s of persistence.
  EXPECT_NEAR(detection.since, 20.456, 0.05);
  EXPECT_NEAR(raised, 21.456, 0.05);
}

// Of the flow that the motion takes, a share looks like a leak where area or flow coefficient are off.
TEST(LeakDetector, MotionTakesAShareForItself) {
  for (const double flow : {0.0, 1.2e-4, -1.2e-4}) {  // m^3/s: 2 % of it over 800 sqrt(Pa) are 3e-9
    const auto detector = of_sheet("internal_leak");
    Detection detection;
    for (int k = 0; k < 10000; ++k) {
      Estimate estimate = quiet(k * 1e-3);
      estimate.quantities[0].value = 4e-9;
      for (Quantity& q : estimate.quantities)
        if (q.name == "piston_flow") q.value = flow;
      detector->process(estimate, detection);
    }
    EXPECT_EQ(detection.active, flow == 0) << flow;
    const double criterion = flow == 0 ? 4e-9 : 4e-9 - 2.6 * 3e-9;
    EXPECT_NEAR(detector->criterion().value, criterion, 1e-11) << flow;
    const double half = 1.6448536 * std::sqrt(std::pow(0.06 * 4e-9, 2) + 2.5e-9 * 2.5e-9 + (flow == 0 ? 0 : 9e-18));
    EXPECT_NEAR(detection.high - detection.size, half * 800, 1e-8) << flow;
  }
}

TEST(LeakDetector, HoldsItsTongueWithoutAPressureDifference) {
  const auto detector = of_sheet("internal_leak");
  Detection detection;
  for (int k = 0; k < 60000; ++k) {
    Estimate estimate = loud(k * 1e-3);
    estimate.quantities[5].value = 300;  // below minimum_drive
    detector->process(estimate, detection);
    ASSERT_FALSE(detection.active) << k;
  }
}

TEST(LeakDetector, WeighsUncertainEstimatesLess) {
  double raised[2] = {0, 0};
  for (int i = 0; i < 2; ++i) {
    const auto detector = of_sheet("internal_leak");
    Detection detection;
    for (int k = 0; k < 60000 && raised[i] == 0; ++k) {
      Estimate estimate = quiet(k * 1e-3);
      estimate.quantities[0].std = i == 0 ? 1e-9 : 6e-9;
      if (k >= 30000) estimate.quantities[0].value = 1e-8;
      detector->process(estimate, detection);
      if (detection.active) raised[i] = k * 1e-3;
    }
  }
  ASSERT_GT(raised[0], 30);
  EXPECT_GT(raised[1], raised[0] + 3);
}

TEST(BandDetector, AveragesAndComparesWithBothLimits) {
  for (const double value : {1.9e4, 2.1e4, -1.9e4, -2.1e4}) {
    const auto detector = of_sheet("pressure_redundancy");
    Detection detection;
    for (int k = 0; k < 30000; ++k) {
      Estimate estimate = quiet(k * 1e-3);
      estimate.quantities[3].value = value + (k % 2 ? 3e4 : -3e4);  // noise is averaged away
      detector->process(estimate, detection);
    }
    EXPECT_EQ(detection.active, std::abs(value) > 2e4) << value;
    EXPECT_NEAR(detection.size, value, 200);
    EXPECT_NEAR(detection.low, detection.size - 2e4, 1e-6);  // a healthy average is anywhere between the limits
    EXPECT_NEAR(detection.high, detection.size + 2e4, 1e-6);
    EXPECT_EQ(detection.low * detection.high > 0, detection.active) << value;  // what is told is not nothing
    EXPECT_EQ(detector->size_unit(), "Pa");
  }
}

TEST(BandDetector, RaisesAfterItsAverageAndItsTime) {
  const auto detector = of_sheet("pressure_redundancy");
  Detection detection;
  double raised = 0;
  for (int k = 0; k < 30000 && raised == 0; ++k) {
    Estimate estimate = quiet(k * 1e-3);
    if (k >= 10000) estimate.quantities[3].value = 4e4;
    detector->process(estimate, detection);
    if (detection.active) raised = k * 1e-3;
  }
  // 1 s average reaches half of 4e4 after ln 2 s; 0.5 s of persistence.
  EXPECT_NEAR(detection.since, 10.693, 0.01);
  EXPECT_NEAR(raised, 11.193, 0.01);
}

TEST(ConsistencyDetector, ComparesTheInnovationPerRow) {
  double limit = 0;
  for (const StageSpec& spec : servo().detectors)
    if (spec.name == "model_fit") limit = spec.settings.number("limit", 0, 1e9);
  for (const double per_row : {0.9 * limit, 1.1 * limit}) {
    const auto detector = of_sheet("model_fit");
    Detection detection;
    for (int k = 0; k < 30000; ++k) {
      Estimate estimate = quiet(k * 1e-3);
      estimate.observed = k % 4 == 0 ? 2 : 4;
      estimate.normalised_innovation = per_row * estimate.observed;
      detector->process(estimate, detection);
    }
    EXPECT_EQ(detection.active, per_row > limit);
    EXPECT_NEAR(detection.size, per_row, 1e-2 * per_row);
  }
}

TEST(ConsistencyDetector, RowsThatAreMissingSayNothing) {
  const auto detector = of_sheet("model_fit");
  Detection detection;
  for (int k = 0; k < 30000; ++k) {
    Estimate estimate = loud(k * 1e-3);
    estimate.observed = 0;
    detector->process(estimate, detection);
    ASSERT_FALSE(detection.active);
  }
}

}  // namespace
}  // namespace faultline
