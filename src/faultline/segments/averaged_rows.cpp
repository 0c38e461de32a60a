#include "faultline/segments/averaged_rows.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "faultline/segments/even_rows.h"
#include "faultline/segments/grid_step.h"
#include "faultline/segments/smoothing.h"

namespace faultline {
namespace {

double mean(const Recording& r, std::size_t column, std::size_t first, std::size_t last) {
  double sum = 0;
  for (std::size_t k = first; k < last; ++k) sum += r.at(k, column);
  return sum / static_cast<double>(last - first);
}

bool on_a_grid(const Datasheet& sheet, const Recording& r, std::size_t column, const SegmentOptions& options) {
  std::vector<double> readings(r.rows());
  for (std::size_t k = 0; k < readings.size(); ++k) readings[k] = r.at(k, column);
  return grid_step(std::move(readings), sheet.channels[column].resolution, options.grid_least_levels, options) > 0;
}

}  // namespace

Recording averaged_rows(const Datasheet& sheet, Recording recording, double period, std::size_t n,
                        const SegmentOptions& options) {
  EvenRows even = even_rows(sheet, std::move(recording), period, options);
  const Recording& r = even.recording;
  std::vector<char> averaged;
  for (std::size_t c = 0; c < sheet.channels.size(); ++c) {
    const Channel& channel = sheet.channels[c];
    const bool reads = (channel.role == Role::output || channel.role == Role::input) && !channel.ground_truth;
    averaged.push_back(reads && !on_a_grid(sheet, r, c, options));
  }
  Recording result;
  result.rig = r.rig;
  result.channels = r.channels;
  std::vector<std::size_t> ends = std::move(even.breaks);
  ends.push_back(r.rows());
  std::size_t first = 0;
  for (const std::size_t end : ends) {
    for (std::size_t row = first; row < end; row += n) {
      Sample sample = r.sample(row);
      sample.sequence = result.sequence.size();
      const std::size_t side = std::min({(n - 1) / 2, row - first, end - 1 - row});
      for (std::size_t c = 0; c < sheet.channels.size(); ++c) {
        if (sheet.channels[c].role == Role::command) sample.values[c] = mean(r, c, row, std::min(row + n, end));
        if (!averaged[c]) continue;
        bool measured = true;
        for (std::size_t k = row - side; k <= row + side; ++k) measured &= measures(sheet.channels[c], r.at(k, c));
        if (measured) sample.values[c] = mean(r, c, row - side, row + side + 1);
      }
      result.append(sample);
    }
    first = end;
  }
  return result;
}

}  // namespace faultline
