#include "faultline/estimators/stretch_collector.h"

#include <cmath>

#include "faultline/segments/even_rows.h"

namespace faultline {

StretchCollector::StretchCollector(const Datasheet& sheet, const ResponseSettings& settings)
    : sheet_(sheet),
      rows_((settings.segments + 1) * static_cast<std::size_t>(std::lround(settings.segment_s / sheet.sample_period))),
      every_s_(settings.every_s),
      period_error_fraction_(settings.segment.period_error_fraction) {}

void StretchCollector::reset() {
  begun_.reset();
  started_ = false;
}

void StretchCollector::drop(double time) {
  begun_.reset();
  next_ = time;
}

std::unique_ptr<Recording> StretchCollector::add(double time, const double* channels, bool good) {
  if (!started_) next_ = time;
  started_ = true;
  if (!good) {
    drop(time);
    return nullptr;
  }
  if (!begun_) {
    if (time < next_) return nullptr;
    begun_ = std::make_unique<Recording>();
    begun_->rig = sheet_.rig;
    begun_->channels = sheet_.channels;
    begun_->time.reserve(rows_);
    begun_->sequence.reserve(rows_);
    begun_->values.reserve(rows_ * sheet_.channels.size());
    next_ = time + every_s_;
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
  if (measured_share(sheet_, *begun_, rows_) >= kLeastMeasured) return std::move(begun_);
  drop(time);
  return nullptr;
}

}  // namespace faultline
