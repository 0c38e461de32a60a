#include "faultline/signal/sequence_monitor.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kLeastTolerance = 1e-3;  // s: what a DAQ's stamps may wander

void check(const char* name, double value, double minimum, double maximum) {
  if (!(value >= minimum && value <= maximum))
    throw InputError(fmt::format("sequence monitor: {} is {}; {} to {} is allowed", name, value, minimum, maximum));
}

}  // namespace

SequenceMonitor::SequenceMonitor(const SequenceSettings& settings) : settings_(settings) {
  check("period [s]", settings_.period, 1e-6, 1e6);
  check("tolerance [s]", settings_.tolerance, 0, 1e6);
  check("late_after [s]", settings_.late_after, 0, 1e6);
  check("drift [s/s]", settings_.drift, 0, 1);
  check("window [samples]", static_cast<double>(settings_.window), 1, 1e7);
  if (settings_.tolerance <= 0) settings_.tolerance = std::max(kLeastTolerance, settings_.period / 2);
  seen_.resize(settings_.window + 1);
  reset();
}

void SequenceMonitor::reset() {
  running_ = paced_ = late_ = false;
  std::fill(seen_.begin(), seen_.end(), 0);
  counts_ = SequenceCounts();
}

void SequenceMonitor::begin(std::uint64_t sequence, double stamp) {
  std::fill(seen_.begin(), seen_.end(), 0);
  running_ = true;
  paced_ = false;
  first_ = highest_ = sequence;
  highest_stamp_ = stamp;
  mark(sequence);
}

void SequenceMonitor::judge_pace(double stamp, double arrival) {
  late_ = false;
  if (!std::isfinite(arrival)) return;
  const double behind = arrival - stamp;
  if (!paced_) {
    paced_ = true;
    pace_ = behind;
    pace_stamp_ = stamp;
    return;
  }
  if (stamp > pace_stamp_) {
    pace_ += settings_.drift * (stamp - pace_stamp_);
    pace_stamp_ = stamp;
  }
  pace_ = std::min(pace_, behind);
  late_ = behind - pace_ > settings_.late_after;
  if (late_) ++counts_.late;
}

Arrival SequenceMonitor::observe(std::uint64_t sequence, double stamp, double arrival) {
  ++counts_.received;
  Arrival result = Arrival::in_order;
  if (!running_) {
    result = Arrival::first;
    begin(sequence, stamp);
  } else if (sequence > highest_) {
    const std::uint64_t step = sequence - highest_;
    const double elapsed = stamp - highest_stamp_;
    const double expected = static_cast<double>(step) * settings_.period;
    if (elapsed < -settings_.tolerance || (step > settings_.window && elapsed < expected / 2)) {
      result = Arrival::restart;
    } else {
      counts_.lost += step - 1;
      if (step > 1) result = Arrival::after_loss;
      highest_ = sequence;
      highest_stamp_ = stamp;
      mark(sequence);
    }
  } else {
    const std::uint64_t back = highest_ - sequence;
    const double expected = highest_stamp_ - static_cast<double>(back) * settings_.period;
    if (back > settings_.window || !(std::abs(stamp - expected) <= settings_.tolerance)) {
      result = Arrival::restart;
    } else if (seen(sequence)) {
      ++counts_.duplicate;
      result = Arrival::duplicate;
    } else {
      ++counts_.out_of_order;
      // What came before the first sample was never counted as lost.
      if (sequence > first_ && counts_.lost > 0) --counts_.lost;
      mark(sequence);
      result = Arrival::out_of_order;
    }
  }
  if (result == Arrival::restart) {
    ++counts_.restarts;
    begin(sequence, stamp);
  }
  judge_pace(stamp, arrival);
  return result;
}

}  // namespace faultline
