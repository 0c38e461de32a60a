#include "faultline/segments/segment_length.h"

#include <algorithm>

#include "faultline/rig/time_scales.h"
#include "faultline/segments/even_rows.h"

namespace faultline {
namespace {

constexpr double kSlowestScales = 10;
constexpr double kLiveScales = 2;
constexpr double kFewestSegments = 16;
constexpr double kFewestSamples = 20;

}  // namespace

double segment_length(const Datasheet& sheet, const std::vector<const Recording*>& runs) {
  if (sheet.segment > 0) return sheet.segment;
  double duration = 0, period = 0;
  for (const Recording* run : runs) {
    const double own = fitted_period(sheet, *run);
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

double live_segment_length(const Datasheet& sheet) {
  if (sheet.segment > 0) return sheet.segment;
  return std::max(kFewestSamples * sheet.sample_period, kLiveScales * time_scales(sheet).slowest_s);
}

}  // namespace faultline
