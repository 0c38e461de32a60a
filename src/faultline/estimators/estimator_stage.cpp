#include "faultline/estimators/estimator_stage.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "faultline/signal/error.h"

namespace faultline {

EstimatorStage::EstimatorStage(const Datasheet& sheet, const StageSpec& spec)
    : name_(spec.name), channels_(sheet.channels), period_(sheet.sample_period) {
  gap_ = spec.settings.number_or("gap", 0.1, period_, 1e6);
  jump_ = spec.settings.number_or("jump", 0.1, 0, 1e6);
  model_ = make_process_model(spec.settings.word("model"), sheet, spec.settings);
  filter_ = make_state_estimator(spec.type, *model_);
  spec.settings.check_used();
  measured_ = model_->measured_channels();
  driving_ = model_->driving_channels();
  held_.assign(channels_.size(), 0);
  states_ = model_->states().size();
}

void EstimatorStage::reset() {
  running_ = false;
  std::fill(held_.begin(), held_.end(), 0);
}

void EstimatorStage::begin(const Sample& sample) {
  std::array<double, kMaximumStates> state{}, variance{};
  model_->initial(held_.data(), state.data(), variance.data());
  filter_->reset(state.data(), variance.data());
  model_->take_inputs(held_.data());
  running_ = true;
  last_time_ = sample.time;
  ++counts_.restarts;
}

bool EstimatorStage::process(const Sample& sample, Estimate& estimate) {
  if (sample.values.size() != channels_.size())
    throw InputError(fmt::format("a sample has {} values, the rig has {} channels: is it another rig's?",
                                 sample.values.size(), channels_.size()));
  const double dt = sample.time - last_time_;
  if (!std::isfinite(sample.time) || (running_ && dt <= 0 && dt >= -jump_)) {
    ++counts_.stale;
    return false;
  }
  bool restart = !running_ || dt < 0 || dt > gap_;

  // Only the channels that this estimator reads are its business; the status of all is told.
  const std::size_t n = channels_.size();
  estimate.channel_status.resize(n);
  for (std::size_t c = 0; c < n; ++c) {
    const double value = sample.values[c];
    ChannelStatus status = ChannelStatus::good;
    if (!std::isfinite(value))
      status = ChannelStatus::missing;
    else if (value < channels_[c].minimum || value > channels_[c].maximum)
      status = ChannelStatus::out_of_range;
    estimate.channel_status[c] = status;
    if (status == ChannelStatus::good) held_[c] = value;
    if (status == ChannelStatus::missing) ++counts_.missing;
    if (status == ChannelStatus::out_of_range) ++counts_.out_of_range;
  }

  std::array<double, kMaximumOutputs> y{};
  std::array<bool, kMaximumOutputs> use{};
  model_->measurement(held_.data(), y.data());
  int observed = 0;
  for (std::size_t i = 0; i < measured_.size(); ++i) {
    use[i] = estimate.channel_status[static_cast<std::size_t>(measured_[i])] == ChannelStatus::good;
    observed += use[i];
  }

  if (restart) {
    begin(sample);
  } else {
    // Lost samples: the model runs on in steps of the sample period with the last commands held.
    const int steps = std::max(1, static_cast<int>(std::lround(dt / period_)));
    for (int i = 0; i < steps; ++i) filter_->predict(dt / steps, dt / steps / period_);
    filter_->correct(y.data(), use.data());
    model_->take_inputs(held_.data());
    last_time_ = sample.time;
    restart = !std::all_of(filter_->state(), filter_->state() + states_, [](double v) { return std::isfinite(v); });
    if (restart) begin(sample);
  }

  estimate.covariance.resize(states_ * states_);
  filter_->covariance(estimate.covariance.data());
  estimate.time = sample.time;
  estimate.sequence = sample.sequence;
  estimate.restarted = restart;
  estimate.state.assign(filter_->state(), filter_->state() + states_);
  estimate.innovation.assign(filter_->innovation(), filter_->innovation() + measured_.size());
  estimate.innovation_std.assign(filter_->innovation_std(), filter_->innovation_std() + measured_.size());
  estimate.normalised_innovation = filter_->normalised_innovation();
  estimate.observed = restart ? 0 : observed;
  model_->quantities(held_.data(), filter_->state(), estimate.covariance.data(), estimate.quantities);
  ++counts_.used;
  return true;
}

}  // namespace faultline
