#include "faultline/estimators/stretch_collector.h"

#include <algorithm>
#include <cmath>

#include "faultline/segments/even_rows.h"

namespace faultline {
namespace {

constexpr double kLater = 2;  // samples, than the judgement, so that clocks that jitter do not turn them

}  // namespace

StretchCollector::StretchCollector(const Datasheet& sheet, const ResponseSettings& settings, double latency_s)
    : sheet_(sheet),
      rows_((settings.segments + 1) * static_cast<std::size_t>(std::lround(settings.segment_s / sheet.sample_period))),
      every_s_(settings.every_s),
      early_every_s_(settings.early_every_s),
      latency_s_(latency_s),
      period_error_fraction_(settings.segment.period_error_fraction),
      early_(settings.early_stretches) {}

void StretchCollector::reset() {
  begun_.reset();
  started_ = false;
  ended_ = 0;
}

std::unique_ptr<Recording> StretchCollector::empty() const {
  auto recording = std::make_unique<Recording>();
  recording->rig = sheet_.rig;
  recording->channels = sheet_.channels;
  recording->time.reserve(rows_);
  recording->sequence.reserve(rows_);
  recording->values.reserve(rows_ * sheet_.channels.size());
  return recording;
}

void StretchCollector::drop(double time) {
  begun_.reset();
  next_ = due_ = time;
}

void StretchCollector::judged(bool undecided) {
  const bool between = begun_ && between_;
  between_ = false;
  if (between && (undecided || begun_->time.back() >= due_)) {  // it takes the place of the one that is due
    due_ = begun_->time.front() + every();
    return;
  }
  if (between) {
    spare_ = std::move(begun_);
    spare_->time.clear();
    spare_->sequence.clear();
    spare_->values.clear();
  }
  if (undecided) due_ = std::min(due_, next_);
  next_ = due_;
}

std::unique_ptr<Recording> StretchCollector::add(double time, const double* channels, bool good) {
  if (!started_) next_ = due_ = time;
  started_ = true;
  if (!good) {
    drop(time);
    return nullptr;
  }
  if (!begun_) {
    if (time < next_) return nullptr;
    begun_ = spare_ ? std::move(spare_) : empty();
    between_ = time < due_;
    if (!between_) {
      due_ = time + every();
      if (std::isfinite(latency_s_)) spare_ = empty();
    }
  }
  if (!begun_->time.empty() && !goes_on(time - begun_->time.back(), sheet_.sample_period, period_error_fraction_)) {
    drop(time);
    return nullptr;
  }
  begun_->time.push_back(time);
  begun_->sequence.push_back(begun_->sequence.size());
  begun_->values.insert(begun_->values.end(), channels, channels + sheet_.channels.size());
  const double passed = (time - begun_->time.front()) / sheet_.sample_period;
  if (static_cast<std::size_t>(std::lround(passed)) + 1 < rows_) return nullptr;
  if (measured_share(sheet_, *begun_, rows_) >= kLeastMeasured) {
    ++ended_;
    const double length = static_cast<double>(rows_) * sheet_.sample_period;
    next_ = std::min(due_, time + std::max(0.0, latency_s_ - length + kLater * sheet_.sample_period));
    return std::move(begun_);
  }
  drop(time);
  return nullptr;
}

bool moves(const Datasheet& sheet, const Recording& stretch) {
  constexpr double kMoves = 3;          // a nuisance in a transducer is up to twice its noise
  constexpr double kLeastShare = 0.01;  // of the range: what a controller makes of noise is less
  const std::size_t width = sheet.channels.size(), rows = stretch.time.size();
  for (std::size_t c = 0; c < width; ++c) {
    const Channel& channel = sheet.channels[c];
    if (channel.role == Role::setpoint || channel.ground_truth) continue;
    double count = 0, mean = 0, squares = 0;
    for (std::size_t row = 0; row < rows; ++row) {
      const double value = stretch.values[row * width + c];
      if (!std::isfinite(value)) continue;
      const double off = value - mean;
      mean += off / ++count;
      squares += off * (value - mean);
    }
    const double sigma = std::hypot(channel.noise_std, channel.resolution / std::sqrt(12.0));
    const double most = std::max(kMoves * sigma, kLeastShare * (channel.maximum - channel.minimum));
    if (count > 1 && squares / count > most * most) return true;
  }
  return false;
}

}  // namespace faultline
