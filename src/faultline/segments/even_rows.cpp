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
constexpr std::size_t kApart = 8;        // rows, over which jitter hardly moves a mean step and rows are seldom missing
constexpr std::size_t kPhaseRows = 25;   // that tell where a grid lies: to a tenth of what the stamps jitter
constexpr double kFollow = 0.1;          // of a deviation: averages jitter over ten rows, follows any clock's drift

// Where the grid lies at a row at which it begins, from the stamps that follow as if none were missing: the row's own
// stamp may be as late as any. Its own where they do not fit.
double grid_at(const Recording& recording, std::size_t row, double period) {
  const std::size_t rows = std::min(kPhaseRows, recording.rows() - row);
  const auto phase = [&](std::size_t i) {
    return recording.time[row + i] - recording.time[row] - static_cast<double>(i) * period;
  };
  double mean = 0;
  for (std::size_t i = 0; i < rows; ++i) mean += phase(i) / static_cast<double>(rows);
  for (std::size_t i = 0; i < rows; ++i)
    if (std::abs(phase(i) - mean) > 0.5 * period) return recording.time[row];
  return recording.time[row] + mean;
}

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
  const std::size_t rows = recording.rows(), apart = std::min(kApart, std::max<std::size_t>(rows, 1) - 1);
  std::vector<double> steps;
  for (std::size_t k = apart; apart > 0 && k < rows; ++k)
    if (recording.time[k] > recording.time[k - apart])
      steps.push_back((recording.time[k] - recording.time[k - apart]) / static_cast<double>(apart));
  if (steps.empty()) return sheet.sample_period;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  const double typical = *middle;
  // The grid is followed row by row: a single step may be nearly none or nearly two, and rows may be missing.
  double sum = 0, periods = 0, expected = grid_at(recording, 0, typical);
  for (std::size_t k = 1; k < rows; ++k) {
    const double count = std::round((recording.time[k] - expected) / typical);
    if (count < 1 || count > kFewPeriods) {
      expected = grid_at(recording, k, typical);
      continue;
    }
    sum += recording.time[k] - recording.time[k - 1];
    periods += count;
    expected += count * typical + kFollow * (recording.time[k] - expected - count * typical);
  }
  const double period = periods > 0 ? sum / periods : typical;
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
  double expected = recording.rows() > 0 ? grid_at(recording, 0, period) : 0;
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
        expected = grid_at(recording, k, period);
      }
    }
    to.append(row);
  }
  return result;
}

}  // namespace faultline
