// A rig that forgets nothing: what is known of it is used up within a few of its time scales, and over long segments
// its model is beside the recording whatever the cause is. Over short ones the cause is seen.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "faultline/gap/diagnose_gap.h"
#include "faultline/numerics/random.h"
#include "faultline/rig/rig.h"

namespace faultline {
namespace {

constexpr double kRate = 8, kGain = 2;  // 1/s, 1/s per V

// x' = rate x + gain u, which a controller holds.
class Balancer : public Rig {
 public:
  Balancer(const Datasheet& sheet, const std::vector<double>& parameters, const EffectSet& effects)
      : parameters_(parameters), voltage_(sheet.channel("voltage")), tilt_(sheet.channel("tilt")) {
    effects.at("command.voltage");
    effects.at("sensor.tilt");
    for (const char* name : {"rate", "gain"}) sheet.parameter(name);
    check_state_names(sheet, {"tilt"});
  }
  int states() const override { return 1; }
  void start(const double*, double* state) override { state[0] = 0; }
  void start_at(const double* nominal, const double*, double* state) override { state[0] = nominal[0]; }
  void derivative(double, const double* state, const double* channels, double* rate) override {
    rate[0] = parameters_[0] * state[0] + parameters_[1] * channels[voltage_];
  }
  void outputs(double, const double* state, double* channels) const override { channels[tilt_] = state[0]; }

 private:
  std::vector<double> parameters_;
  int voltage_, tilt_;
};

FAULTLINE_RIG(balancer, {"balancer", 1e-3, make_rig<Balancer>});

constexpr const char* kBalancer = R"(rig: balancer
title: what falls over
source: test
sample_period: 0.005
segment: 1
conventions: test
channels:
  - {name: voltage, symbol: u, unit: V, role: command, range: [-10, 10], noise_std: 0, resolution: 0, meaning: in}
  - {name: tilt, symbol: x, unit: rad, role: output, range: [-5, 5], noise_std: 2e-4, resolution: 0, meaning: out}
states:
  - {name: tilt, symbol: x, unit: rad, measured_by: tilt, initial: 0}
parameters:
  - {name: rate, symbol: a, unit: 1/s, nominal: 8, tolerance: 0.02, identify: true, from: chosen}
  - {name: gain, symbol: b, unit: 1/(s V), nominal: 2, tolerance: 0.02, identify: true, from: chosen}
constants: {}
equations: x' = a x + b u
ports:
  command.voltage:
    component: drive
    meaning: in
    range: 10
    effects: {offset: {value: [-1, 1]}, deadband: {width: [0, 2]}}
  sensor.tilt:
    component: transducer
    meaning: out
    channel: tilt
    effects: {offset: {value: [-0.1, 0.1]}, lag: {time_constant: [0.001, 0.1]}}
)";

Datasheet balancer() {
  const std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("faultline_balancer_" + std::to_string(::getpid()));
  std::filesystem::create_directory(folder);
  const std::string file = (folder / "rig.yaml").string();
  std::ofstream(file) << kBalancer;
  const Datasheet read = read_datasheet(file);
  std::filesystem::remove_all(folder);
  return read;
}

// Exact between samples, but for gusts; the drive has a dead zone.
Recording balancer_run(std::uint64_t seed, double dead, double gust) {
  constexpr double kPeriod = 0.005;
  Recording recording;
  recording.rig = "balancer";
  recording.channels = balancer().channels;
  Random random(seed);
  double x = 0, aim = 0;
  const double grows = std::exp(kRate * kPeriod);
  for (int k = 0; k * kPeriod < 12; ++k) {
    if (k % 60 == 0) aim = random.uniform(-0.5, 0.5);
    const double read = x + 2e-4 * random.normal(), u = -12 * (read - aim);
    recording.time.push_back(k * kPeriod);
    recording.sequence.push_back(static_cast<std::uint64_t>(k));
    recording.values.push_back(u);
    recording.values.push_back(read);
    const double passed = std::copysign(std::max(0.0, std::abs(u) - 0.5 * dead), u);
    x = grows * x + (grows - 1) / kRate * kGain * passed + gust * random.normal();
  }
  return recording;
}

GapResult diagnose(std::size_t least_samples) {
  std::vector<SegmentedRun> runs;
  for (const std::uint64_t seed : {1, 2}) runs.push_back(cut_run(balancer(), "run", balancer_run(seed, 0.6, 4e-4), 1));
  GapSettings settings;
  settings.jobs = 2;
  settings.options.shorter.least_samples = least_samples;
  return diagnose_gap(balancer(), std::move(runs), {}, settings, {});
}

TEST(Shorter, NamesWhatLongSegmentsDoNotShow) {
  const GapResult usual = diagnose(51);  // of 50 in a quarter of a segment
  EXPECT_EQ(usual.verdict, "unknown") << usual.sentence;
  const GapResult result = diagnose(50);
  EXPECT_EQ(result.verdict, "named") << result.sentence;
  ASSERT_EQ(result.effects.size(), 1u) << result.sentence;
  EXPECT_EQ(result.effects.front().effect, "deadband");
  EXPECT_NEAR(result.effects.front().parameters.at("width"), 0.6, 0.1);
  EXPECT_TRUE(std::any_of(result.remarks.begin(), result.remarks.end(), [](const std::string& remark) {
    return remark.find("over segments of 0.25 s, of which a usual one holds 4") != std::string::npos;
  }));
}

}  // namespace
}  // namespace faultline
