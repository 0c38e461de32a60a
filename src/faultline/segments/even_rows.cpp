#include "faultline/segments/even_rows.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "faultline/segments/segmented_run.h"

namespace faultline {
namespace {

constexpr double kFewPeriods = 4;        // a longer step says nothing of the period: it need not be a multiple of it
constexpr double kMostMissing = 3;       // rows over which commands and inputs are known well enough from both sides
constexpr double kClockFraction = 2e-3;  // of a period, that is no other period: crystals are off by far less
constexpr double kFollow = 0.1;          // of a deviation: averages jitter over ten rows, follows any clock's drift

// Rows between the last of `to` and the first of `next`, which comes in `missing` + 1 periods.
void fill(const Datasheet& sheet, const Sample& next, std::size_t missing, Recording& to) {
  const Sample before = to.sample(to.rows() - 1);
  for (std::size_t i = 1; i <= missing; ++i) {
    const double share = static_cast<double>(i) / static_cast<double>(missing + 1);
    Sample row;
    row.time = before.time + share * (next.time - before.time);
    row.sequence = before.sequence + i;
    for (std::size_t c = 0; c < before.values.size(); ++c) {
      const Role role = sheet.channels[c].role;
      row.values.push_back(role == Role::command || role == Role::input
                               ? before.values[c] + share * (next.values[c] - before.values[c])
                               : std::numeric_limits<double>::quiet_NaN());
    }
    to.append(row);
  }
}

}  // namespace

double fitted_period(const Datasheet& sheet, const Recording& recording) {
  std::vector<double> steps;
  for (std::size_t k = 1; k < recording.rows(); ++k)
    if (recording.time[k] > recording.time[k - 1]) steps.push_back(recording.time[k] - recording.time[k - 1]);
  if (steps.empty()) return sheet.sample_period;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  const double typical = *middle;
  double sum = 0, periods = 0;
  for (const double step : steps) {
    if (step > (kFewPeriods + 0.5) * typical) continue;
    sum += step;
    periods += std::round(step / typical);
  }
  const double period = sum / periods;
  return std::abs(period - sheet.sample_period) <= kClockFraction * sheet.sample_period ? sheet.sample_period : period;
}

bool goes_on(double step, double period, double error_fraction) {
  const double periods = std::round(step / period);
  return periods >= 1 && periods <= kMostMissing + 1 && std::abs(step - periods * period) <= error_fraction * period;
}

double measured_share(const Datasheet& sheet, const Recording& recording, std::size_t rows) {
  std::size_t read = 0;
  const std::vector<int> outputs = compared_outputs(sheet);
  for (const int output : outputs)
    for (std::size_t k = 0; k < recording.rows(); ++k)
      read += std::isfinite(recording.at(k, static_cast<std::size_t>(output)));
  return static_cast<double>(read) / static_cast<double>(std::max<std::size_t>(1, rows * outputs.size()));
}

EvenRows even_rows(const Datasheet& sheet, Recording recording, double period, const SegmentOptions& options) {
  EvenRows result;
  Recording& to = result.recording;
  to.rig = recording.rig;
  to.channels = recording.channels;
  double expected = recording.rows() > 0 ? recording.time.front() : 0;
  for (std::size_t k = 0; k < recording.rows(); ++k) {
    const Sample row = recording.sample(k);
    if (k > 0) {
      const double periods = std::round((row.time - expected) / period);
      const double off = row.time - expected - periods * period;
      if (periods >= 1 && periods <= kMostMissing + 1 && std::abs(off) <= options.period_error_fraction * period) {
        const auto missing = static_cast<std::size_t>(periods) - 1;
        if (missing > 0) fill(sheet, row, missing, to);
        result.filled += missing;
        expected += periods * period + kFollow * off;
      } else {
        if (result.breaks.empty())
          result.first_break = fmt::format("{:g} s between the samples at {:.3f} s", row.time - recording.time[k - 1],
                                           row.time - recording.time.front());
        result.breaks.push_back(to.rows());
        expected = row.time;
      }
    }
    to.append(row);
  }
  return result;
}

}  // namespace faultline
