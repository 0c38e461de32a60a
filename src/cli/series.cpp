#include "cli/series.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include <fmt/format.h>

namespace faultline {
namespace {

double root(double variance) { return std::sqrt(std::max(0.0, variance)); }

}  // namespace

Series::Series(const Datasheet& sheet, const Diagnosis& diagnosis, std::size_t rows)
    : diagnosis_(diagnosis), most_((rows + 7) / 8 * 8) {  // so that stretches are always in pairs

  for (const Channel& channel : sheet.channels) channels_.push_back(channel.name);
}

void Series::name_columns() {
  text_ = "t";
  for (const std::string& name : channels_) text_ += "," + name;
  for (std::size_t i = 0; i < diagnosis_.estimators(); ++i) {
    for (const State& state : diagnosis_.estimator(i).states()) text_ += fmt::format(",x.{0},x.{0}.std", state.name);
    for (const Quantity& q : diagnosis_.estimate(i).quantities) text_ += fmt::format(",q.{0},q.{0}.std", q.name);
    const std::vector<std::string> innovation = diagnosis_.estimator(i).innovation_names();
    for (const std::string& name : innovation) text_ += fmt::format(",i.{0},i.{0}.std", name);
    if (innovation.empty()) continue;
    text_ += i == 0 ? ",normalised_innovation" : ",normalised_innovation." + diagnosis_.estimator(i).name();
  }
  text_ += '\n';
}

void Series::add(double time, const Sample& sample) {
  if (text_.empty()) name_columns();
  values_.assign(sample.values.begin(), sample.values.end());
  for (std::size_t stage = 0; stage < diagnosis_.estimators(); ++stage) {
    const Estimate& estimate = diagnosis_.estimate(stage);
    const std::size_t n = estimate.state.size();
    for (std::size_t i = 0; i < n; ++i) {
      values_.push_back(estimate.state[i]);
      values_.push_back(root(estimate.covariance[i * n + i]));
    }
    for (const Quantity& quantity : estimate.quantities) {
      values_.push_back(quantity.value);
      values_.push_back(quantity.std);
    }
    for (std::size_t i = 0; i < estimate.innovation.size(); ++i) {
      values_.push_back(estimate.innovation[i]);
      values_.push_back(estimate.innovation_std[i]);
    }
    if (!estimate.innovation.empty()) values_.push_back(estimate.normalised_innovation);
  }
  if (length_ == 1) {
    if (times_.size() < most_) {
      times_.push_back(time);
      rows_.insert(rows_.end(), values_.begin(), values_.end());
      return;
    }
    start_stretches();
  }
  if (samples_ % length_ == 0) {
    if (stretches_.size() == most_ / 2) join_pairs();
    if (samples_ % length_ == 0) start(time);
  }
  add_to_last(time);
}

void Series::start(double time) {
  const double none = std::numeric_limits<double>::quiet_NaN();
  stretches_.push_back({time, time});
  extremes_.resize(extremes_.size() + values_.size(), {none, none, 0, 0});
}

void Series::add_to_last(double time) {
  stretches_.back().end = time;
  Extremes* extremes = extremes_.data() + extremes_.size() - values_.size();
  for (std::size_t c = 0; c < values_.size(); ++c) {
    Extremes& e = extremes[c];
    const double value = values_[c];
    if (std::isnan(value)) continue;
    if (!(value >= e.low)) {
      e.low = value;
      e.low_at = samples_;
    }
    if (!(value <= e.high)) {
      e.high = value;
      e.high_at = samples_;
    }
  }
  ++samples_;
}

void Series::start_stretches() {
  const std::vector<double> newest = values_;
  length_ = 4;
  for (std::size_t i = 0; i < times_.size(); ++i) {
    const auto first = rows_.begin() + static_cast<std::ptrdiff_t>(i * newest.size());
    values_.assign(first, first + static_cast<std::ptrdiff_t>(newest.size()));
    if (samples_ % length_ == 0) start(times_[i]);
    add_to_last(times_[i]);
  }
  values_ = newest;
  times_ = {};
  rows_ = {};
}

void Series::join_pairs() {
  const std::size_t columns = values_.size();
  for (std::size_t i = 0; i < stretches_.size() / 2; ++i) {
    stretches_[i] = {stretches_[2 * i].begin, stretches_[2 * i + 1].end};
    for (std::size_t c = 0; c < columns; ++c) {
      Extremes joined = extremes_[2 * i * columns + c];
      const Extremes& next = extremes_[(2 * i + 1) * columns + c];
      if (!(next.low >= joined.low) && !std::isnan(next.low)) {
        joined.low = next.low;
        joined.low_at = next.low_at;
      }
      if (!(next.high <= joined.high) && !std::isnan(next.high)) {
        joined.high = next.high;
        joined.high_at = next.high_at;
      }
      extremes_[i * columns + c] = joined;
    }
  }
  stretches_.resize(stretches_.size() / 2);
  extremes_.resize(stretches_.size() * columns);
  length_ *= 2;
}

void Series::row(double time, const double* values) {
  fmt::format_to(std::back_inserter(text_), "{:.6f}", time);
  for (std::size_t c = 0; c < values_.size(); ++c) {
    const double value = values[c];
    if (std::isnan(value))
      text_ += ",nan";
    else
      fmt::format_to(std::back_inserter(text_), ",{:.7g}", value);
  }
  text_ += '\n';
}

std::string Series::csv() {
  const std::size_t columns = values_.size();
  for (std::size_t i = 0; i < times_.size(); ++i) row(times_[i], rows_.data() + i * columns);
  std::vector<double> first(columns), second(columns);
  for (std::size_t i = 0; i < stretches_.size(); ++i) {
    for (std::size_t c = 0; c < columns; ++c) {
      const Extremes& e = extremes_[i * columns + c];
      const bool rising = e.low_at <= e.high_at;
      first[c] = rising ? e.low : e.high;
      second[c] = rising ? e.high : e.low;
    }
    const auto [begin, end] = stretches_[i];
    row(begin + 0.25 * (end - begin), first.data());
    if (end > begin) row(begin + 0.75 * (end - begin), second.data());
  }
  return std::move(text_);
}

}  // namespace faultline
