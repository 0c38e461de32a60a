#include "faultline/segments/own_samples.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "faultline/numerics/quantiles.h"

namespace faultline {
namespace {

constexpr std::size_t kMostEvery = 20;    // beyond, a run's period is no longer believed (cli/load_recording.cpp)
constexpr std::size_t kFewestKinks = 50;  // from which a channel has a say
constexpr double kKinkFraction = 1e-3;    // of the median step: what digits of a text leave is less
constexpr double kInPhase = 0.98;         // of the kinks
constexpr double kFilled = 0.7;           // of the rows of that phase, that must have one

// Rows at which a channel has a kink.
std::vector<std::size_t> kinks_of(const Recording& r, std::size_t column) {
  std::vector<double> steps;
  for (std::size_t k = 1; k < r.rows(); ++k) {
    const double step = std::abs(r.at(k, column) - r.at(k - 1, column));
    if (step > 0) steps.push_back(step);
  }
  if (steps.empty()) return {};
  const double least = kKinkFraction * median(std::move(steps));
  std::vector<std::size_t> kinks;
  for (std::size_t k = 1; k + 1 < r.rows(); ++k)
    if (std::abs(r.at(k + 1, column) - 2 * r.at(k, column) + r.at(k - 1, column)) > least) kinks.push_back(k);
  return kinks;
}

// Kinks by their row modulo `every`.
std::array<std::size_t, kMostEvery> by_phase(const std::vector<std::size_t>& kinks, std::size_t every) {
  std::array<std::size_t, kMostEvery> counts{};
  for (const std::size_t k : kinks) ++counts[k % every];
  return counts;
}

// Rows at which a value is not that of the row before.
std::vector<std::size_t> changes_of(const Recording& r, std::size_t column) {
  std::vector<std::size_t> changes;
  for (std::size_t k = 1; k < r.rows(); ++k)
    if (r.at(k, column) != r.at(k - 1, column)) changes.push_back(k);
  return changes;
}

bool in_phase(const std::vector<std::size_t>& rows, const OwnSamples& own) {
  return static_cast<double>(by_phase(rows, own.every)[own.first]) >= kInPhase * static_cast<double>(rows.size());
}

// Whether a command says nothing between the samples: it was interpolated as they were, or held from one to the next.
bool keeps_pace(const Recording& r, std::size_t column, const OwnSamples& own) {
  return in_phase(kinks_of(r, column), own) || in_phase(changes_of(r, column), own);
}

}  // namespace

OwnSamples own_samples(const Recording& recording) {
  std::vector<std::vector<std::size_t>> channels;
  for (std::size_t c = 0; c < recording.columns(); ++c) {
    const Channel& channel = recording.channels[c];
    if (channel.ground_truth || (channel.role != Role::output && channel.role != Role::input)) continue;
    std::vector<std::size_t> kinks = kinks_of(recording, c);
    if (kinks.size() >= kFewestKinks) channels.push_back(std::move(kinks));
  }
  for (std::size_t every = kMostEvery; every > 1 && !channels.empty(); --every) {
    const auto counts = by_phase(channels.front(), every);
    const auto first = static_cast<std::size_t>(std::max_element(counts.begin(), counts.end()) - counts.begin());
    const double rows = static_cast<double>(recording.rows()) / static_cast<double>(every);
    bool filled = false;
    const bool all = std::all_of(channels.begin(), channels.end(), [&](const std::vector<std::size_t>& kinks) {
      filled = filled || static_cast<double>(by_phase(kinks, every)[first]) > kFilled * rows;
      return in_phase(kinks, {every, first});
    });
    if (!all || !filled) continue;
    const OwnSamples own = {every, first};
    for (std::size_t c = 0; c < recording.columns(); ++c)
      if (recording.channels[c].role == Role::command && !keeps_pace(recording, c, own)) return {};
    return own;
  }
  return {};
}

Recording at_own_samples(const Recording& recording, const OwnSamples& own) {
  Recording result;
  result.rig = recording.rig;
  result.channels = recording.channels;
  for (std::size_t k = own.first; k < recording.rows(); k += own.every) {
    result.time.push_back(recording.time[k]);
    result.sequence.push_back(result.sequence.size());
    result.values.insert(result.values.end(), recording.row(k), recording.row(k) + recording.columns());
  }
  return result;
}

}  // namespace faultline
