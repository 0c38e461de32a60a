#include "faultline/gap/stuck_times.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace faultline {
namespace {

constexpr double kBesideNormal = 3;      // standard deviations beyond what so many normal readings span
constexpr double kNeighbourhood = 0.05;  // of the longest run, on both sides
constexpr double kSegmentsBeside = 1.5;  // on both sides of the first segment that is not followed
constexpr double kQuiet = 1e-3;          // noise variances, of what the model leaves; less is no quieter

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

struct Segment {
  double time;   // s from the beginning of its run
  double level;  // logarithm of the mean square of what the nominal model leaves
};

std::vector<Segment> segments_of(const ResidualModel& residuals) {
  std::vector<Segment> result;
  for (std::size_t r = 0; r < residuals.runs().size(); ++r) {
    const SegmentedRun& run = residuals.runs()[r];
    const Eigen::MatrixXf left = residuals.residuals(residuals.model().nominal(), r);
    for (const std::size_t first : run.restarts) {
      const auto rows = left.middleRows(static_cast<Eigen::Index>(first), static_cast<Eigen::Index>(run.segment));
      const double square = static_cast<double>(rows.squaredNorm()) / static_cast<double>(rows.size());
      result.push_back({run.recording.time[first] - run.recording.time.front(), std::log(std::max(square, kQuiet))});
    }
  }
  std::stable_sort(result.begin(), result.end(), [](const Segment& a, const Segment& b) { return a.time < b.time; });
  return result;
}

}  // namespace

double still_since(const std::vector<SegmentedRun>& runs, std::size_t channel, double resolution, double noise) {
  double since = 0;
  for (const SegmentedRun& run : runs) since = std::max(since, still_since(run, channel, resolution, noise));
  return since;
}

double not_followed_since(const ResidualModel& residuals) {
  const std::vector<Segment> segments = segments_of(residuals);
  double sum_all = 0, square_all = 0, sum = 0, square = 0, most = 0, since = -1;
  for (const Segment& s : segments) sum_all += s.level, square_all += s.level * s.level;
  for (std::size_t t = 1; t < segments.size(); ++t) {
    const double level = segments[t - 1].level;
    sum += level, square += level * level;
    const double first = static_cast<double>(t), second = static_cast<double>(segments.size() - t);
    const double step = (sum_all - sum) / second - sum / first;
    const double scatter =
        square - sum * sum / first + square_all - square - (sum_all - sum) * (sum_all - sum) / second;
    const double score = first * second / (first + second) * step * std::abs(step) / (scatter + 1);
    if (score <= most) continue;
    most = score;
    since = segments[t].time;
  }
  return since;
}

std::vector<Candidate> where_still(const std::vector<Candidate>& candidates, const ResidualModel& residuals) {
  double duration = 0;
  for (const SegmentedRun& run : residuals.runs()) duration = std::max(duration, run.duration());
  const SegmentedRun& first = residuals.runs().front();
  const double segment = static_cast<double>(first.segment) * first.period;
  std::optional<double> leaves;
  std::vector<Candidate> result;
  for (Candidate candidate : candidates) {
    if (candidate.family == "stuck" && port_kind(candidate.effect.port) == PortKind::command) {
      if (!leaves) leaves = not_followed_since(residuals);
      if (*leaves >= 0) {
        result.push_back(candidate);
        result.back().bounds.front() = {std::max(0.0, *leaves - kSegmentsBeside * segment),
                                        std::min(duration, *leaves + kSegmentsBeside * segment)};
      }
    }
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
