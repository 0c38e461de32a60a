#include "faultline/gap/stuck_times.h"

#include <algorithm>
#include <cmath>

namespace faultline {
namespace {

constexpr double kBesideNormal = 3;      // standard deviations beyond what so many normal readings span
constexpr double kNeighbourhood = 0.05;  // of the longest run, on both sides

double still_since(const SegmentedRun& run, std::size_t channel, double resolution, double noise) {
  double least = 0, most = 0, count = 0, since = run.duration();
  for (std::size_t k = run.recording.rows(); k-- > 0;) {
    const double reading = run.reading(k, channel);
    if (!std::isfinite(reading)) continue;
    least = count > 0 ? std::min(least, reading) : reading;
    most = count > 0 ? std::max(most, reading) : reading;
    ++count;
    // So many normal readings lie within twice this of each other (extreme values).
    const double span = std::sqrt(2 * std::log(count)) + 0.5 * kBesideNormal;
    if (most - least > 2 * span * noise + resolution) break;
    // In less than a segment a signal turns; of one half may be missing.
    if (run.recording.rows() - k >= run.segment && 2 * count >= static_cast<double>(run.segment))
      since = run.recording.time[k] - run.recording.time.front();
  }
  return since;
}

}  // namespace

double still_since(const std::vector<SegmentedRun>& runs, std::size_t channel, double resolution, double noise) {
  double since = 0;
  for (const SegmentedRun& run : runs) since = std::max(since, still_since(run, channel, resolution, noise));
  return since;
}

std::vector<Candidate> where_still(const std::vector<Candidate>& candidates, const ResidualModel& residuals) {
  double duration = 0;
  for (const SegmentedRun& run : residuals.runs()) duration = std::max(duration, run.duration());
  std::vector<Candidate> result;
  for (Candidate candidate : candidates) {
    if (candidate.family == "stuck" && port_kind(candidate.effect.port) == PortKind::sensor) {
      const auto c =
          static_cast<std::size_t>(residuals.sheet().channel(residuals.sheet().port(candidate.effect.port).channel));
      const Channel& channel = residuals.sheet().channels[c];
      const auto output = std::find(residuals.outputs().begin(), residuals.outputs().end(), static_cast<int>(c));
      const double noise = output != residuals.outputs().end()
                               ? residuals.noise()[static_cast<std::size_t>(output - residuals.outputs().begin())]
                               : noise_of(channel);
      const double since = still_since(residuals.runs(), c, channel.resolution, noise);
      if (since >= duration) continue;
      candidate.bounds.front() = {std::max(0.0, since - kNeighbourhood * duration), since + kNeighbourhood * duration};
    }
    result.push_back(std::move(candidate));
  }
  return result;
}

}  // namespace faultline
