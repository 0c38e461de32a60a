#include "faultline/signal/sample_check.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace faultline {
namespace {

constexpr std::size_t kSteps = 1000;  // how many the median is taken of
constexpr double kGap = 1.5;          // periods
constexpr double kPeriodTolerance = 0.01;

}  // namespace

void SampleCheck::add(const Sample& sample) {
  SampleFindings& f = findings_;
  for (const double value : sample.values)
    if (!std::isfinite(value)) ++f.missing;
  if (f.samples++ > 0) {
    const double dt = sample.time - last_time_;
    if (dt < 0 && f.backward++ == 0) f.first_backward = sample.time;
    if (dt == 0) ++f.duplicates;
    if (dt > 0 && steps_.size() < kSteps) steps_.push_back(dt);
    if (dt > kGap * period_) {
      if (f.gaps++ == 0) f.first_gap = last_time_;
      f.longest_gap = std::max(f.longest_gap, dt);
    }
    if (dt > 0 && sample.sequence > last_sequence_ + 1) f.lost += sample.sequence - last_sequence_ - 1;
  }
  last_time_ = sample.time;
  last_sequence_ = sample.sequence;
}

SampleFindings SampleCheck::findings() const {
  SampleFindings result = findings_;
  std::vector<double> steps = steps_;
  if (!steps.empty()) {
    const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
    std::nth_element(steps.begin(), middle, steps.end());
    result.period = *middle;
  }
  return result;
}

std::vector<std::string> describe(const SampleFindings& f, double period, double start) {
  std::vector<std::string> lines;
  const auto plural = [](std::uint64_t n) { return n == 1 ? "" : "s"; };
  if (f.gaps > 0)
    lines.push_back(fmt::format("{} gap{} in time, the first after {:.3f} s, the longest {:.3g} s", f.gaps,
                                plural(f.gaps), f.first_gap - start, f.longest_gap));
  if (f.lost > 0) lines.push_back(fmt::format("{} sample{} lost by the DAQ's count", f.lost, plural(f.lost)));
  if (f.backward > 0)
    lines.push_back(fmt::format("time runs backwards {} time{}, first to {:.3f} s", f.backward, plural(f.backward),
                                f.first_backward - start));
  if (f.duplicates > 0)
    lines.push_back(fmt::format("{} sample{} with the time of the one before", f.duplicates, plural(f.duplicates)));
  if (f.missing > 0) lines.push_back(fmt::format("{} number{} missing (nan)", f.missing, plural(f.missing)));
  if (!period_fits(f, period))
    lines.push_back(fmt::format("samples come every {:.4g} s, the rig's datasheet says {:.4g} s", f.period, period));
  return lines;
}

bool period_fits(const SampleFindings& findings, double period) {
  return findings.period == 0 || std::abs(findings.period - period) <= kPeriodTolerance * period;
}

}  // namespace faultline
