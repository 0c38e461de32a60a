#include "faultline/segments/segment_length.h"

#include <algorithm>

#include "faultline/rig/time_scales.h"

namespace faultline {
namespace {

constexpr double kSlowestScales = 10;
constexpr double kFewestSegments = 16;
constexpr double kFewestSamples = 20;

}  // namespace

double typical_period(const Datasheet& sheet, const Recording& recording) {
  std::vector<double> steps;
  for (std::size_t k = 1; k < recording.rows(); ++k)
    if (recording.time[k] > recording.time[k - 1]) steps.push_back(recording.time[k] - recording.time[k - 1]);
  if (steps.empty()) return sheet.sample_period;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

double segment_length(const Datasheet& sheet, const std::vector<const Recording*>& runs) {
  if (sheet.segment > 0) return sheet.segment;
  double duration = 0, period = 0;
  for (const Recording* run : runs) {
    const double own = typical_period(sheet, *run);
    period = std::max(period, own);
    duration += static_cast<double>(run->rows()) * own;
  }
  return std::max(kFewestSamples * period,
                  std::min(kSlowestScales * time_scales(sheet).slowest_s, duration / kFewestSegments));
}

double segment_length(const Datasheet& sheet) {
  if (sheet.segment > 0) return sheet.segment;
  return std::max(kFewestSamples * sheet.sample_period, kSlowestScales * time_scales(sheet).slowest_s);
}

}  // namespace faultline
