#include "faultline/signal/row_assembly.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace faultline {
namespace {

constexpr std::size_t kIntervals = 16;  // that tell a signal's period; jitter of 10 % leaves it good to 1 %
constexpr double kUsual = 1.5;          // of their median: longer ones hold a lost sample
// A signal up to 5 % faster than the rows folds only what lies above 0.95 of half their rate back to just below it.
constexpr double kFaster = 0.95;
constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();

double usual_interval(std::vector<double> intervals) {
  std::vector<double> sorted = intervals;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  double sum = 0;
  std::size_t count = 0;
  for (const double interval : intervals) {
    if (interval > kUsual * *middle) continue;
    sum += interval;
    ++count;
  }
  return sum / static_cast<double>(count);
}

}  // namespace

RowAssembler::RowAssembler(const AssemblyPlan& plan, Deliver deliver)
    : plan_(plan), deliver_(std::move(deliver)), filter_(plan.period), signals_(plan.signals.size()) {
  row_.resize(signals_.size());
}

void RowAssembler::restart() {
  for (Signal& signal : signals_) signal = Signal();
  leader_times_.clear();
  begun_ = settled_ = finished_ = false;
  newest_ = made_ = -kInfinite;
  number_ = 0;
}

RowAssembler::Taken RowAssembler::push(std::size_t place, double time, double value) {
  Signal& signal = signals_[place];
  const SignalPlan& plan = plan_.signals[place];
  if (!(time > signal.newest)) return Taken::backward;
  if (!plan_.resample && place == plan_.leader) leader_times_.push_back(time);
  const bool is_value = plan.held || !std::isnan(value);
  if (is_value) {
    const double interval = time - signal.newest;
    if (signal.count == 0) {
      signal.first = time;
    } else {
      signal.longest = std::max(signal.longest, interval);
      if (signal.intervals.size() < kIntervals) signal.intervals.push_back(interval);
    }
    ++signal.count;
    signal.newest = time;
    double until = kInfinite;
    if (!std::isnan(plan.hold))
      until = time + plan.hold;
    else if (signal.count > 1)
      until = time + kGapPeriods * std::max(plan_.period, signal.longest);
    signal.points.push_back({time, value, until});
  }
  newest_ = std::max(newest_, time);
  settled_ = false;
  const bool late = time <= made_;
  learn_period(place, false);
  make_rows();
  return late ? Taken::late : Taken::yes;
}

void RowAssembler::settle() {
  settled_ = true;
  make_rows();
}

void RowAssembler::finish() {
  finished_ = settled_ = true;
  for (std::size_t i = 0; i < signals_.size(); ++i) learn_period(i, true);
  make_rows();
}

void RowAssembler::learn_period(std::size_t place, bool last_chance) {
  Signal& signal = signals_[place];
  if (!plan_.resample || plan_.signals[place].held || signal.period > 0 || signal.intervals.empty()) return;
  const bool enough = signal.intervals.size() == kIntervals || last_chance ||
                      signal.newest - signal.first >= static_cast<double>(kIntervals) * plan_.period;
  if (!enough) return;
  signal.period = usual_interval(signal.intervals);
  signal.filtered = signal.period < kFaster * plan_.period;
}

double RowAssembler::gap(const Signal& signal) const { return kGapPeriods * std::max(plan_.period, signal.period); }

double RowAssembler::reach(const Signal& signal) const { return signal.filtered ? filter_.reach() : 0; }

bool RowAssembler::silent(std::size_t place) const {
  const Signal& signal = signals_[place];
  if (signal.count == 0) return true;
  return !plan_.signals[place].held && newest_ - signal.newest > gap(signal);
}

// Whether every signal has begun, and so the first row is known.
bool RowAssembler::begin() {
  if (begun_) return true;
  double start = -kInfinite;
  for (std::size_t i = 0; i < signals_.size(); ++i) {
    const Signal& signal = signals_[i];
    if (signal.count == 0) return false;
    if (plan_.resample && !plan_.signals[i].held && !(signal.period > 0)) return false;
    start = std::max(start, signal.first + reach(signal));
  }
  start_ = start;
  while (!leader_times_.empty() && leader_times_.front() < start) leader_times_.pop_front();
  begun_ = true;
  return true;
}

bool RowAssembler::row_time(double& time) const {
  if (!plan_.resample) {
    if (leader_times_.empty()) return false;
    time = leader_times_.front();
    return true;
  }
  time = start_ + static_cast<double>(number_) * plan_.period;
  return true;
}

bool RowAssembler::ready(double time) const {
  if (finished_) {
    // To where the first of them ends, those that fell silent before left out.
    double newest = -kInfinite, last = kInfinite;
    for (std::size_t i = 0; i < signals_.size(); ++i)
      if (!plan_.signals[i].held) newest = std::max(newest, signals_[i].newest);
    for (std::size_t i = 0; i < signals_.size(); ++i)
      if (!plan_.signals[i].held && newest - signals_[i].newest <= gap(signals_[i]))
        last = std::min(last, signals_[i].newest - reach(signals_[i]));
    return time <= last;
  }
  bool any = false;
  for (std::size_t i = 0; i < signals_.size(); ++i) {
    const Signal& signal = signals_[i];
    if (plan_.signals[i].held) {
      if (signal.newest < time && !settled_ && newest_ - time < plan_.wait) return false;
    } else if (signal.newest >= time + reach(signal)) {
      any = true;
    } else if (!(newest_ - signal.newest > gap(signal) + plan_.wait)) {
      return false;
    }
  }
  // Where all that is measured fell silent, nothing tells how far rows go on.
  return any;
}

void RowAssembler::make_rows() {
  if (!begin()) return;
  for (double time = 0; row_time(time) && ready(time);) {
    bool any = false;
    for (std::size_t i = 0; i < signals_.size(); ++i) {
      row_[i] = value(i, time);
      any = any || (!plan_.signals[i].held && !std::isnan(row_[i]));
    }
    made_ = time;
    const std::uint64_t number = number_++;
    if (!plan_.resample) leader_times_.pop_front();
    if (any) deliver_(time, number, row_);
  }
}

double RowAssembler::value(std::size_t place, double time) {
  Signal& signal = signals_[place];
  std::deque<Point>& points = signal.points;
  const double oldest = time - reach(signal);
  while (points.size() > 1 && points[1].time <= oldest) points.pop_front();
  if (points.empty() || points.front().time > oldest) return kMissing;
  if (plan_.signals[place].held) return time <= points.front().until ? points.front().value : kMissing;

  if (!signal.filtered) {
    const Point& before = points.front();
    if (before.time == time) return before.value;
    if (points.size() < 2) return kMissing;
    const Point& after = points[1];
    if (after.time - before.time > gap(signal)) return kMissing;
    if (!plan_.resample && std::min(time - before.time, after.time - time) > plan_.period / 2) return kMissing;
    return before.value + (after.value - before.value) * (time - before.time) / (after.time - before.time);
  }
  // The first point lies at or before the reach, and the last one that counts has one behind it: its weight is known.
  double sum = 0, weights = 0;
  for (std::size_t i = 1; i < points.size(); ++i) {
    const Point& point = points[i];
    const double back = point.time - points[i - 1].time;
    if (back > gap(signal)) return kMissing;
    if (point.time >= time + filter_.reach()) return sum / weights;
    if (i + 1 == points.size()) break;
    const double weight = filter_.weight(point.time - time) * (points[i + 1].time - points[i - 1].time) / 2;
    sum += weight * point.value;
    weights += weight;
  }
  return kMissing;
}

}  // namespace faultline
