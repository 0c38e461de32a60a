#include "faultline/gap/slow_drift.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Dense>

#include "faultline/attribution/candidates.h"

namespace faultline {
namespace {

constexpr Eigen::Index kFewest = 8;  // segments
constexpr double kNoRate = 0.5;      // of the rate, from which it is missed in what it should have moved
constexpr double kMiddle = 0.5, kTwelfth = 1.0 / 12;

struct Slope {
  double apart = 0, mean = 0, change = 0;
};

std::optional<Slope> slope(const SegmentedRun& run, std::size_t first, std::size_t channel, std::size_t rate) {
  const auto n = static_cast<double>(run.segment);
  double moved = 0, with_time = 0, sum = 0;
  for (std::size_t k = 0; k < run.segment; ++k) {
    const double y = run.reading(first + k, channel), r = run.reading(first + k, rate);
    if (!std::isfinite(y) || !std::isfinite(r)) return std::nullopt;
    // Deviation of the time from its mean, in samples: what is constant has no part in it.
    with_time += (static_cast<double>(k) - kMiddle * (n - 1)) * (y - moved);
    moved += r * run.period;
    sum += r;
  }
  Slope result;
  result.apart = with_time / (n * (n * n - 1) * kTwelfth) / run.period;
  result.mean = sum / n;
  result.change = run.reading(first + run.segment - 1, rate) - run.reading(first, rate);
  return result;
}

}  // namespace

std::optional<int> rate_channel(const Datasheet& sheet, int channel) {
  const auto shown = [&](int c) {
    return std::any_of(sheet.states.begin(), sheet.states.end(), [&](const State& s) { return s.channel == c; });
  };
  if (!shown(channel)) return std::nullopt;
  const std::string unit = sheet.channels[static_cast<std::size_t>(channel)].unit + "/s";
  for (int c = 0; c < static_cast<int>(sheet.channels.size()); ++c)
    if (sheet.channels[static_cast<std::size_t>(c)].unit == unit && shown(c)) return c;
  return std::nullopt;
}

std::optional<RateApart> rate_apart(const std::vector<SegmentedRun>& runs, int channel, int rate) {
  std::vector<Slope> slopes;
  for (const SegmentedRun& run : runs)
    for (const std::size_t first : run.restarts)
      if (const auto one = slope(run, first, static_cast<std::size_t>(channel), static_cast<std::size_t>(rate)))
        slopes.push_back(*one);
  const auto n = static_cast<Eigen::Index>(slopes.size());
  if (n < kFewest) return std::nullopt;
  Eigen::MatrixXd of(n, 3);
  Eigen::VectorXd apart(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Slope& s = slopes[static_cast<std::size_t>(i)];
    of.row(i) << 1, s.mean, s.change;
    apart[i] = s.apart;
  }
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> solver(of);
  if (solver.rank() < 3) return std::nullopt;
  const Eigen::Vector3d fitted = solver.solve(apart);
  if (std::abs(fitted[1]) > kNoRate) return std::nullopt;
  const double variance = (apart - of * fitted).squaredNorm() / static_cast<double>(n - 3);
  const Eigen::Matrix3d inverse = (of.transpose() * of).inverse();
  return RateApart{fitted[0], std::sqrt(variance * inverse(0, 0))};
}

std::optional<RunsAway> what_runs_away(const Datasheet& sheet, const std::vector<SegmentedRun>& runs,
                                       const std::vector<SegmentedRun>& holdout,
                                       const std::vector<std::string>& without, const GapOptions::SlowDrift& options) {
  RunsAway result;
  std::size_t segments = 0;
  for (const SegmentedRun& run : runs) segments += run.segments();
  result.times = std::min(options.most_joined, segments / options.least_segments);
  if (result.times < 2) return std::nullopt;
  for (const Candidate& candidate : candidates(sheet, without)) {
    const EffectSpec& effect = candidate.effect;
    if (effect.effect != "drift" || port_kind(effect.port) != PortKind::sensor) continue;
    result.port = effect.port;
    result.channel = sheet.port(effect.port).channel;
    const int channel = sheet.channel(result.channel);
    const std::optional<int> rate = rate_channel(sheet, channel);
    if (!rate) continue;
    result.runs.clear();
    for (const SegmentedRun& run : runs) result.runs.push_back(joined_segments(run, result.times));
    const std::optional<RateApart> apart = rate_apart(result.runs, channel, *rate);
    if (!apart || std::abs(apart->rate) < options.standard_errors * apart->standard_error) continue;
    result.apart = *apart;
    for (const SegmentedRun& run : holdout) result.holdout.push_back(joined_segments(run, result.times));
    for (const auto* list : {&result.runs, &result.holdout})
      for (const SegmentedRun& run : *list)
        if (run.restarts.empty()) return std::nullopt;
    return result;
  }
  return std::nullopt;
}

std::string told(const Datasheet& sheet, const RunsAway& found) {
  return fmt::format("{} leaves the integral of its measured rate by {:.3g} +- {:.1g} {}/s", found.channel,
                     found.apart.rate, found.apart.standard_error,
                     sheet.channels[static_cast<std::size_t>(sheet.channel(found.channel))].unit);
}

}  // namespace faultline
