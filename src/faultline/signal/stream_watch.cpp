#include "faultline/signal/stream_watch.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <fmt/format.h>

namespace faultline {
namespace {

constexpr double kWindow = 10;  // s
constexpr double kLeast = 10, kMost = 100;
constexpr double kRate = 0.01, kOff = 0.25, kJitter = 0.1;
constexpr double kPause = 5;  // medians: a longer step is a pause of the source and says nothing about its pace

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

StreamWatch::StreamWatch(double period)
    : period_(period), window_(static_cast<std::size_t>(std::clamp(kWindow / period, kLeast, kMost))) {
  steps_.reserve(window_);
}

void StreamWatch::add(std::uint64_t sequence, double stamp) {
  ++samples_;
  if (stamp == 0) ++zero_;
  if (any_) {
    if (stamp == last_stamp_) ++still_;
    if (sequence == last_sequence_) ++not_counting_;
    if (stamp > last_stamp_)
      steps_.push_back({stamp - last_stamp_, static_cast<double>(sequence) - static_cast<double>(last_sequence_)});
  }
  any_ = true;
  last_stamp_ = stamp;
  last_sequence_ = sequence;
  if (samples_ < window_) return;
  trouble_ = judge();
  samples_ = zero_ = still_ = not_counting_ = 0;
  steps_.clear();
}

std::string StreamWatch::judge_numbers() const {
  std::vector<double> stamps, numbers;
  for (const Step& step : steps_) {
    stamps.push_back(step.stamp);
    numbers.push_back(step.number);
  }
  const auto back =
      static_cast<std::size_t>(std::count_if(numbers.begin(), numbers.end(), [](double number) { return number < 0; }));
  const double usual = median(numbers);
  const bool alike = 2 * static_cast<std::size_t>(std::count(numbers.begin(), numbers.end(), usual)) > numbers.size();
  constexpr const char* kOneByOne = "so no loss can be seen; the source must number its samples one by one";
  if (static_cast<double>(back) > kJitter * static_cast<double>(numbers.size()))
    return fmt::format("the samples' numbers {}, {}", alike && usual < 0 ? "count down" : "jump about", kOneByOne);
  if (usual > 1 && std::abs(median(stamps) - period_) <= kOff * period_)
    return fmt::format("the samples' numbers {}, {}",
                       alike ? fmt::format("count in steps of {:.0f}", usual) : "jump about", kOneByOne);
  return "";
}

std::string StreamWatch::judge() {
  const auto most = [this](std::size_t count) { return 2 * count > samples_; };
  if (most(zero_)) return "the samples' stamps are 0; the source must stamp them with the time of measurement";
  if (most(still_)) return "the samples' stamps stand still; the source must stamp each with its time of measurement";
  if (most(not_counting_))
    return fmt::format(
        "the samples' numbers do not count (all are {}), so no loss can be seen; the source must number "
        "its samples",
        last_sequence_);
  if (steps_.empty()) return "";
  if (std::string numbers = judge_numbers(); !numbers.empty()) return numbers;
  std::vector<double> steps;
  for (const Step& step : steps_) steps.push_back(step.stamp / std::max(1.0, step.number));
  std::sort(steps.begin(), steps.end());
  const double longest = kPause * steps[steps.size() / 2];  // of the median
  while (steps.back() > longest) steps.pop_back();
  const auto count = static_cast<double>(steps.size());
  const double mean = std::accumulate(steps.begin(), steps.end(), 0.0) / count;
  const auto off =
      std::count_if(steps.begin(), steps.end(), [&](double step) { return std::abs(step - mean) > kOff * period_; });
  const double share = static_cast<double>(off) / count;
  if (std::abs(mean - period_) > kOff * period_ || (share <= kJitter && std::abs(mean - period_) > kRate * period_))
    return fmt::format("samples come every {:.4g} s, the rig's datasheet says {:.4g} s", mean, period_);
  if (share > kJitter)
    return fmt::format("the samples' stamps jitter: {:.0f} % of their steps are more than a quarter of {:.4g} s off",
                       100 * share, period_);
  return "";
}

}  // namespace faultline
