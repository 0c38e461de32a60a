#include "cli/series.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include <fmt/format.h>

namespace faultline {
namespace {

constexpr std::size_t kRows = 4000;

double root(double variance) { return std::sqrt(std::max(0.0, variance)); }

}  // namespace

Series::Series(const Datasheet& sheet, const Diagnosis& diagnosis, std::size_t rows)
    : diagnosis_(diagnosis), stretch_(rows <= kRows ? 1 : (rows + kRows / 2 - 1) / (kRows / 2)) {
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
  if (stretch_ == 1) {
    row(time, values_);
    return;
  }
  extremes_.resize(values_.size());
  for (std::size_t c = 0; c < values_.size(); ++c) {
    Extremes& e = extremes_[c];
    const double value = values_[c];
    if (std::isnan(value)) continue;
    if (!e.any || value < e.low) {
      e.low = value;
      e.low_at = in_stretch_;
    }
    if (!e.any || value > e.high) {
      e.high = value;
      e.high_at = in_stretch_;
    }
    e.any = true;
  }
  times_.push_back(time);
  if (++in_stretch_ == stretch_) end_stretch();
}

void Series::end_stretch() {
  if (in_stretch_ == 0) return;
  const double none = std::numeric_limits<double>::quiet_NaN();
  first_.assign(extremes_.size(), none);
  second_.assign(extremes_.size(), none);
  for (std::size_t c = 0; c < extremes_.size(); ++c) {
    const Extremes& e = extremes_[c];
    if (!e.any) continue;
    first_[c] = e.low_at <= e.high_at ? e.low : e.high;
    second_[c] = e.low_at <= e.high_at ? e.high : e.low;
  }
  row(times_[in_stretch_ / 4], first_);
  if (in_stretch_ > 1) row(times_[3 * in_stretch_ / 4], second_);
  std::fill(extremes_.begin(), extremes_.end(), Extremes());
  times_.clear();
  in_stretch_ = 0;
}

void Series::row(double time, const std::vector<double>& values) {
  fmt::format_to(std::back_inserter(text_), "{:.6f}", time);
  for (const double value : values) {
    if (std::isnan(value))
      text_ += ",nan";
    else
      fmt::format_to(std::back_inserter(text_), ",{:.7g}", value);
  }
  text_ += '\n';
}

std::string Series::csv() {
  end_stretch();
  return std::move(text_);
}

}  // namespace faultline
