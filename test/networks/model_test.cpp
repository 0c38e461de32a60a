// Signals of a network, its file, and the virtual sensor that runs it.
#include "faultline/networks/model.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "allocations.h"
#include "faultline/estimators/estimator_stage.h"
#include "faultline/signal/butterworth.h"
#include "faultline/signal/error.h"
#include "networks/networks.h"

namespace faultline {
namespace {

namespace fs = std::filesystem;

NetworkModel model_of(const NetworkShape& shape) {
  NetworkModel model;
  model.shape = shape;
  model.trained = shape.feedback;
  model.inputs.centre.assign(shape.inputs.size(), 0.25);
  model.inputs.scale.assign(shape.inputs.size(), 2);
  model.outputs.centre.assign(shape.outputs.size(), 1);
  model.outputs.scale.assign(shape.outputs.size(), 4);
  model.rms.assign(shape.outputs.size(), 0.125);
  model.weights = initial_weights(shape, 3);
  return model;
}

template <class Work>
std::string refusal(Work work) {
  try {
    work();
  } catch (const InputError& error) {
    return error.what();
  }
  return "taken";
}

TEST(Butterworth, AmplitudeAndLag) {
  const double period = 1e-3;
  for (const auto& [frequency, amplitude] :
       std::vector<std::pair<double, double>>{{0.5, 1}, {15, std::sqrt(0.5)}, {150, 0.0090}}) {
    Butterworth filter(15, period);
    filter.start(0);
    double most = 0;
    for (int k = 0; k < 6000; ++k) {
      const double y = filter.step(std::sin(2 * M_PI * frequency * period * k));
      if (k > 3000) most = std::max(most, std::abs(y));
    }
    EXPECT_NEAR(most, amplitude, 1e-3) << frequency;
  }
  Butterworth filter(15, period);
  EXPECT_NEAR(filter.lag(), 0.0150, 1e-4);
  filter.start(7);
  EXPECT_DOUBLE_EQ(filter.step(7), 7);  // as if it had always been so
  double y = 0;
  for (int k = 1; k < 2000; ++k) y = filter.step(7 + k * period);
  EXPECT_NEAR(7 + 1.999 - y, filter.lag(), 1e-9);  // a ramp comes out late by the lag
  EXPECT_THROW(Butterworth(500, period), InputError);
}

TEST(NetworkSignals, SmoothAndRate) {
  const NetworkShape shape = network_shape(plant(), structured("own"));  // u, w, w.smooth, w.rate
  NetworkSignals signals(shape);
  const double start[] = {1, 2, 0, 0};
  signals.start(start);
  EXPECT_EQ(signals.inputs(), Eigen::Vector4d(1, 2, 2, 0));
  Butterworth filter(5, 0.01);
  filter.start(2);
  for (int k = 1; k < 50; ++k) {
    const double now[] = {1, 2 + 0.1 * k, 0, 0}, before = filter.step(now[1]);
    signals.step(now);
    EXPECT_DOUBLE_EQ(signals.inputs()[2], before);
  }
  EXPECT_NEAR(signals.inputs()[3], 10, 1e-3);  // 0.1 per 0.01 s
}

TEST(NetworkSignals, HolesBeginNewRuns) {
  const Datasheet sheet = plant();
  const NetworkShape shape = network_shape(sheet, black_box("none"));
  Recording recording;
  recording.channels = sheet.channels;
  for (int k = 0; k < 500; ++k) {
    const double nan = std::nan("");
    const double a = k == 20 ? nan : k == 21 ? 1e3 : k;
    recording.append({k * 0.01 + (k < 250 ? 0 : 0.5) + (k < 450 ? 0 : 0.5), 0, {1, 2, a, 4}});
  }
  const std::vector<NetworkRun> runs = network_runs(shape, recording, "F");
  ASSERT_EQ(runs.size(), 2U);  // the third is shorter than a second
  EXPECT_EQ(runs[0].outputs.cols(), 250);
  EXPECT_EQ(runs[1].outputs.cols(), 200);
  EXPECT_EQ(runs[0].outputs(0, 20), 19);  // missing: held
  EXPECT_EQ(runs[0].outputs(0, 21), 19);  // out of range: held
  recording.time.resize(0);
  EXPECT_EQ(refusal([&] { network_runs(shape, recording, "F"); }).substr(0, 27), "F: no 100 samples in a row,");
}

TEST(NetworkModel, FileGoesThereAndBack) {
  const NetworkShape shape = network_shape(plant(), structured("own"));
  const NetworkModel model = model_of(shape);
  References kept{"plant", "", {{"net", to_reference(model)}}};
  const References read = parse_references(to_text(kept), "plant", "F");
  const NetworkModel back = to_model(shape, read.stages[0].reference);
  EXPECT_EQ(back.weights, model.weights);
  EXPECT_EQ(back.outputs.scale, model.outputs.scale);
  EXPECT_EQ(back.rms, model.rms);
  EXPECT_EQ(back.trained, Feedback::own);
}

TEST(NetworkModel, Refusals) {
  const NetworkShape shape = network_shape(plant(), structured("own"));
  const Reference good = to_reference(model_of(shape));
  Reference other = good;
  other.version = 2;
  EXPECT_EQ(refusal([&] { to_model(shape, other); }),
            "the network is of version 2, this program reads version 1; train it anew");
  other = good;
  other.type = "histogram";
  EXPECT_EQ(refusal([&] { to_model(shape, other); }),
            "this is a reference of type histogram, not a network; train it anew");
  other = good;
  other.numbers[0] = 0.002;
  EXPECT_EQ(refusal([&] { to_model(shape, other); }),
            "the network was trained with period = 0.002, this stage has 0.01; train it anew");
  other = good;
  other.numbers[4] = 0;  // a scale
  EXPECT_EQ(refusal([&] { to_model(shape, other); }), "the network's scale of u is not positive; train it anew");
  const NetworkShape larger = network_shape(plant(), structured("own", 4));
  EXPECT_EQ(
      refusal([&] { to_model(larger, good); }),
      "the network is of another structure than this stage: it has a.0.bias where the stage has a.3.sum; train it "
      "anew");
  const NetworkShape box = network_shape(plant(), black_box("own"));
  EXPECT_NE(refusal([&] { to_model(box, good); }).find("another structure"), std::string::npos);
}

class Sensor : public ::testing::Test {
 protected:
  Sensor() : folder_(fs::temp_directory_path() / ("network_" + std::to_string(::getpid()))) {
    fs::create_directories(folder_);
    sheet_.file = (folder_ / "rig.yaml").string();
  }
  ~Sensor() override { fs::remove_all(folder_); }
  StageSpec spec(Settings settings, const NetworkModel& model) {
    write_references({"plant", "", {{"net", to_reference(model)}}}, (folder_ / "net.txt").string());
    settings.set("weights", std::string("net.txt"));
    return {"net", "network", settings};
  }
  fs::path folder_;
  Datasheet sheet_ = plant();
};

TEST_F(Sensor, EstimatesAsTheNetworkDoes) {
  const NetworkShape shape = network_shape(sheet_, structured("own"));
  const NetworkModel model = model_of(shape);
  EstimatorStage stage(sheet_, spec(structured("own"), model));
  Network network(shape);
  NetworkSignals signals(shape);
  Estimate estimate;
  Random random(1);
  double square = 0;  // of a's residual, its mean over 2 s
  for (int k = 0; k < 200; ++k) {
    const Sample sample{
        k * 0.01, static_cast<std::uint64_t>(k), {random.normal(), random.normal(), random.normal(), random.normal()}};
    Eigen::VectorXd outputs(2);
    outputs << (sample.values[2] - 1) / 4, (sample.values[3] - 1) / 4;
    if (k == 0)
      signals.start(sample.values.data());
    else
      signals.step(sample.values.data());
    const Eigen::VectorXd inputs = (signals.inputs().array() - 0.25) / 2;
    if (k == 0)
      network.start(inputs.data(), outputs.data());
    else
      network.step(model.weights.data(), inputs.data());
    ASSERT_TRUE(stage.process(sample, estimate));
    ASSERT_EQ(estimate.quantities.size(), 4U);
    EXPECT_NEAR(estimate.quantities[0].value, 1 + 4 * network.outputs()[0], 1e-12);
    EXPECT_NEAR(estimate.quantities[3].value, sample.values[3] - (1 + 4 * network.outputs()[1]), 1e-12);
    if (k > 0) {
      network.take(outputs.data());
      square += (std::pow(estimate.quantities[1].value, 2) - square) / std::min(200, k);
      EXPECT_NEAR(estimate.quantities[0].std, std::max(0.125, std::sqrt(square)), 1e-9);
    }
  }
  EXPECT_GT(std::sqrt(square), 0.5);
  EXPECT_EQ(estimate.quantities[0].name, "a_network");
  EXPECT_EQ(estimate.quantities[3].name, "b_network_residual");
  const Sample last{2, 200, {0, 0, 0, 0}};
  const std::uint64_t before = allocations();
  stage.process(last, estimate);
  EXPECT_EQ(allocations(), before);
}

TEST_F(Sensor, StaysInTheChannelsRangeAndForgetsADeadTransmitter) {
  NetworkModel model = model_of(network_shape(sheet_, structured("all")));
  model.weights.tail(3).setConstant(50);  // b integrates away
  EstimatorStage stage(sheet_, spec(structured("all"), model));
  Estimate estimate;
  for (int k = 0; k < 3000; ++k) {
    stage.process({k * 0.01, static_cast<std::uint64_t>(k), {5, 5, std::nan(""), std::nan("")}}, estimate);
    for (const Quantity& q : estimate.quantities) ASSERT_TRUE(std::isfinite(q.value)) << k;
    ASSERT_LE(std::abs(estimate.quantities[2].value), 100 + 1e-9);
  }
  EXPECT_EQ(stage.counts().restarts, 1U);
  // Trained with other feedback, it has no word on its error until it has seen some.
  EstimatorStage other(sheet_, spec(structured("own"), model));
  Estimate fresh;
  other.process({0, 0, {0, 0, 0, 0}}, fresh);
  EXPECT_EQ(fresh.quantities[0].std, 0);
  other.process({0.01, 1, {0, 0, 0, 0}}, fresh);
  EXPECT_EQ(fresh.quantities[0].std, std::abs(fresh.quantities[1].value));
}

TEST_F(Sensor, RefusesFilesThatAreNotItsOwn) {
  const NetworkModel model = model_of(network_shape(sheet_, structured("own")));
  const StageSpec good = spec(structured("own"), model);
  const std::string file = (folder_ / "net.txt").string();
  std::stringstream stream;
  stream << std::ifstream(file).rdbuf();
  const std::string text = stream.str();
  const auto with = [&](const std::string& content) {
    std::ofstream(file) << content;
    return refusal([&] { EstimatorStage(sheet_, good); });
  };
  EXPECT_NE(with(text.substr(0, text.size() / 2)).find("net.txt: the file is damaged or cut off"), std::string::npos);
  std::string damaged = text;
  damaged[damaged.size() / 2] ^= 1;
  EXPECT_NE(with(damaged).find("damaged or cut off"), std::string::npos);
  References other{"mill", "", {{"net", to_reference(model)}}};
  EXPECT_NE(with(to_text(other)).find("these are references of the rig mill, not of plant"), std::string::npos);
  other = {"plant", "", {{"another", to_reference(model)}}};
  EXPECT_NE(with(to_text(other)).find("the file holds no network of the stage 'net'"), std::string::npos);
  fs::remove(file);
  EXPECT_NE(refusal([&] { EstimatorStage(sheet_, good); }).find("net.txt: the references cannot be read"),
            std::string::npos);
  EXPECT_EQ(with(text), "taken");
}

}  // namespace
}  // namespace faultline
