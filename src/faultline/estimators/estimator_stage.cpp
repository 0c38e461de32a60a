#include "faultline/estimators/estimator_stage.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

// Without a setting: what the alarms take for silence (alarms/alarm_options.h), beyond any jitter.
constexpr double kGapPeriods = 100, kLeastGap = 0.1;  // s

// What an estimator refuses it may say without knowing where its settings stand.
std::unique_ptr<Estimator> make_estimator(const Datasheet& sheet, const StageSpec& spec) {
  const EstimatorType& type = estimator_type(spec);
  try {
    return type.make(sheet, spec);
  } catch (const InputError& error) {
    const std::string text = error.what();
    for (const std::string& file : {sheet.file, sheet.stages_file})
      if (!file.empty() && text.rfind(file, 0) == 0) throw;
    throw InputError(spec.settings.where() + ": " + text);
  }
}

}  // namespace

EstimatorStage::EstimatorStage(const Datasheet& sheet, const StageSpec& spec)
    : name_(spec.name), channels_(sheet.channels), period_(sheet.sample_period) {
  estimator_ = make_estimator(sheet, spec);
  const double usual = std::max(kLeastGap, kGapPeriods * period_);
  gap_ = spec.settings.number_or("gap", std::max(usual, estimator_->bridges()), period_, 1e6);
  jump_ = spec.settings.number_or("jump", usual, 0, 1e6);
  spec.settings.check_used();
  held_.assign(channels_.size(), 0);
  usable_.resize(channels_.size());
  if (!sheet.estimators.empty() && sheet.estimators.front().name == spec.name)
    for (const Channel& channel : channels_) watches_.emplace_back(channel);
}

void EstimatorStage::reset() {
  running_ = false;
  std::fill(held_.begin(), held_.end(), 0);
}

void EstimatorStage::begin(const Sample& sample) {
  estimator_->begin(held_.data());
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
  if (restart)
    for (ChannelWatch& watch : watches_) watch.reset();

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
    usable_[c] = estimate.channel_status[c] = status;
    if (status == ChannelStatus::good) held_[c] = value;
    if (status == ChannelStatus::good && !watches_.empty()) estimate.channel_status[c] = watches_[c].add(value);
    if (status == ChannelStatus::missing) ++counts_.missing;
    if (status == ChannelStatus::out_of_range) ++counts_.out_of_range;
  }

  if (restart) {
    begin(sample);
  } else {
    // Lost samples: the model runs on in steps of the sample period with the last commands held.
    const int steps = std::max(1, static_cast<int>(std::lround(dt / period_)));
    last_time_ = sample.time;
    restart = !estimator_->advance(held_.data(), usable_.data(), dt, steps);
    if (restart) begin(sample);
  }

  ++counts_.used;
  news_ = restart || estimator_->news();
  estimate.time = sample.time;
  estimate.sequence = sample.sequence;
  estimate.restarted = restart;
  if (news_) estimator_->write(held_.data(), restart, estimate);
  return true;
}

void restore_stage(const References& references, EstimatorStage& stage) {
  for (const auto& [name, reference] : references.stages) {
    if (name != stage.name()) continue;
    try {
      stage.restore(reference);
    } catch (const InputError& error) {
      throw InputError(
          fmt::format("{}{}{}: {}", references.file, references.file.empty() ? "" : ": ", name, error.what()));
    }
  }
}

}  // namespace faultline
