// The estimator `network`: a trained network (networks/network.h) as a virtual sensor of channels.
//
// Quantities, per output: CHANNEL_network, its estimate, and CHANNEL_network_residual, measured minus estimated; their
// standard deviation is the network's rms error when it was trained (0 where that was with other feedback than here),
// or the rms residual of the last `memory` s where that is more: a network does not know where it leaves what it was
// trained on, but a transmitter that still reads does. Where none reads it is what it was last.
// No estimate leaves its channel's range. With feedback all, estimates begin from the mean of the training, so that a
// transmitter that is dead spoils nothing; with own, from what is measured. Where samples are lost it runs on with the
// latest inputs.
//
// Settings: those of the network (networks/shape.h); `weights`, its file, beside the datasheet (`faultline train`);
// memory [2] (s).
#include <algorithm>
#include <cmath>
#include <filesystem>

#include "faultline/estimators/estimator.h"
#include "faultline/networks/model.h"
#include "faultline/networks/network.h"

namespace faultline {
namespace {

class NetworkEstimator : public Estimator {
 public:
  NetworkEstimator(const Datasheet& sheet, const StageSpec& spec)
      : model_(read(sheet, spec)),
        network_(model_.shape),
        signals_(model_.shape),
        memory_(spec.settings.number_or("memory", 2, 1e-6, 1e8)),
        squares_(model_.shape.outputs.size(), 0.0) {
    for (std::size_t o = 0; o < model_.shape.outputs.size(); ++o) {
      const Channel& c = sheet.channels[model_.shape.outputs[o].channel];
      units_.push_back(c.unit);
      low_.push_back((c.minimum - model_.outputs.centre[o]) / model_.outputs.scale[o]);
      high_.push_back((c.maximum - model_.outputs.centre[o]) / model_.outputs.scale[o]);
    }
    measured_.setZero(static_cast<Eigen::Index>(units_.size()));
    inputs_.setZero(static_cast<Eigen::Index>(model_.shape.inputs.size()));
  }

  std::vector<State> states() const override { return {}; }
  std::vector<std::string> innovation_names() const override { return {}; }

  void begin(const double* channels) override {
    signals_.start(channels);
    scale(channels);
    if (model_.shape.feedback == Feedback::all) measured_.setZero();
    network_.start(inputs_.data(), measured_.data());
    std::fill(squares_.begin(), squares_.end(), 0.0);
    age_ = 0;
  }

  bool advance(const double* channels, const ChannelStatus* status, double dt, int steps) override {
    for (int i = 0; i < steps; ++i) {
      signals_.step(channels);
      scale(channels);
      network_.step(model_.weights.data(), inputs_.data());
      network_.bound(low_.data(), high_.data());
      network_.take(measured_.data());
    }
    age_ += dt;
    const double gain = std::min(1.0, dt / std::min(memory_, age_));
    for (std::size_t o = 0; o < squares_.size(); ++o) {
      const std::size_t channel = model_.shape.outputs[o].channel;
      const double residual = channels[channel] - estimate_of(o);
      if (status[channel] == ChannelStatus::good) squares_[o] += gain * (residual * residual - squares_[o]);
    }
    return network_.outputs().allFinite();
  }

  void write(const double* channels, bool, Estimate& estimate) const override {
    if (estimate.quantities.empty())
      for (std::size_t o = 0; o < units_.size(); ++o) {
        const std::string name = model_.shape.outputs[o].name + "_network";
        estimate.quantities.push_back({name, units_[o], 0, 0});
        estimate.quantities.push_back({name + "_residual", units_[o], 0, 0});
      }
    for (std::size_t o = 0; o < units_.size(); ++o) {
      const double value = estimate_of(o), rms = model_.trained == model_.shape.feedback ? model_.rms[o] : 0;
      estimate.quantities[2 * o].std = estimate.quantities[2 * o + 1].std = std::max(rms, std::sqrt(squares_[o]));
      estimate.quantities[2 * o].value = value;
      estimate.quantities[2 * o + 1].value = channels[model_.shape.outputs[o].channel] - value;
    }
    estimate.observed = 0;
  }

 private:
  double estimate_of(std::size_t output) const {
    return model_.outputs.centre[output] +
           model_.outputs.scale[output] * network_.outputs()[static_cast<Eigen::Index>(output)];
  }

  static NetworkModel read(const Datasheet& sheet, const StageSpec& spec) {
    const NetworkShape shape = network_shape(sheet, spec.settings);
    const std::string& named_in = sheet.stages_file.empty() ? sheet.file : sheet.stages_file;
    const std::filesystem::path folder = std::filesystem::path(named_in).parent_path();
    return read_network((folder / spec.settings.word("weights")).string(), sheet.rig, spec.name, shape);
  }

  void scale(const double* channels) {
    for (Eigen::Index i = 0; i < inputs_.size(); ++i) {
      const auto at = static_cast<std::size_t>(i);
      inputs_[i] = (signals_.inputs()[i] - model_.inputs.centre[at]) / model_.inputs.scale[at];
    }
    for (Eigen::Index o = 0; o < measured_.size(); ++o) {
      const auto at = static_cast<std::size_t>(o);
      measured_[o] =
          (channels[model_.shape.outputs[at].channel] - model_.outputs.centre[at]) / model_.outputs.scale[at];
    }
  }

  NetworkModel model_;
  Network network_;
  NetworkSignals signals_;
  std::vector<std::string> units_;
  std::vector<double> low_, high_;
  Eigen::VectorXd inputs_, measured_;
  double memory_, age_ = 0;      // s
  std::vector<double> squares_;  // of residuals, their mean
};

FAULTLINE_ESTIMATOR(network, {"network", "neural", false, make_estimator_of<NetworkEstimator>});

}  // namespace
}  // namespace faultline
