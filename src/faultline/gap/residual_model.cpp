#include "faultline/gap/residual_model.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr int kSmoothing = 6;            // samples on each side for start states
constexpr double kLargest = 1e4;         // residuals beyond this many sigmas are cut
constexpr double kFirstDifference = 20;  // variance of a third difference of unit white noise: 1 + 9 + 9 + 1

// Value at the centre of a quadratic fitted over 2 w + 1 samples (Savitzky-Golay), fewer at the ends.
double smoothed(const Recording& recording, std::size_t row, std::size_t column) {
  const auto w = static_cast<std::ptrdiff_t>(kSmoothing);
  const auto centre = static_cast<std::ptrdiff_t>(row);
  if (centre < w || centre + w >= static_cast<std::ptrdiff_t>(recording.rows())) {
    double sum = 0;
    int count = 0;
    for (std::ptrdiff_t k = std::max<std::ptrdiff_t>(0, centre - 1);
         k <= std::min(centre + 1, static_cast<std::ptrdiff_t>(recording.rows()) - 1); ++k, ++count)
      sum += recording.at(static_cast<std::size_t>(k), column);
    return sum / count;
  }
  double s0 = 0, s2 = 0, s4 = 0, y0 = 0, y2 = 0;
  for (std::ptrdiff_t i = -w; i <= w; ++i) {
    const double x2 = static_cast<double>(i * i);
    const double y = recording.at(static_cast<std::size_t>(centre + i), column);
    s0 += 1;
    s2 += x2;
    s4 += x2 * x2;
    y0 += y;
    y2 += x2 * y;
  }
  return (s4 * y0 - s2 * y2) / (s0 * s4 - s2 * s2);
}

double smoothing_factor() {  // standard error of `smoothed` per unit noise
  double s0 = 0, s2 = 0, s4 = 0;
  for (int i = -kSmoothing; i <= kSmoothing; ++i) {
    const double x2 = static_cast<double>(i * i);
    s0 += 1;
    s2 += x2;
    s4 += x2 * x2;
  }
  return std::sqrt(s4 / (s0 * s4 - s2 * s2));
}

}  // namespace

double noise_floor(const Recording& recording, std::size_t column) {
  std::vector<double> sizes;
  sizes.reserve(recording.rows());
  for (std::size_t k = 3; k < recording.rows(); ++k)
    sizes.push_back(std::abs(recording.at(k, column) - 3 * recording.at(k - 1, column) +
                             3 * recording.at(k - 2, column) - recording.at(k - 3, column)));
  if (sizes.empty()) return 0;
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return *middle / 0.67449 / std::sqrt(kFirstDifference);
}

GapRun prepare_run(const Datasheet& sheet, const std::string& name, Recording recording, std::size_t segment) {
  if (recording.rows() < 2 * segment)
    throw InputError(fmt::format("{}: {} samples are too few; a gap needs at least {} ({:g} s)", name, recording.rows(),
                                 2 * segment, static_cast<double>(2 * segment) * sheet.sample_period));
  for (std::size_t k = 1; k < recording.rows(); ++k) {
    const double dt = recording.time[k] - recording.time[k - 1];
    if (std::abs(dt - sheet.sample_period) > 0.2 * sheet.sample_period)
      throw InputError(fmt::format(
          "{}: {:g} s between the samples at {:.3f} s, the rig has {:g} s; cut the run there or resample it", name, dt,
          recording.time[k] - recording.time.front(), sheet.sample_period));
  }
  for (std::size_t c = 0; c < sheet.channels.size(); ++c) {
    const Channel& channel = sheet.channels[c];
    for (std::size_t k = 0; k < recording.rows(); ++k) {
      double& value = recording.values[k * recording.columns() + c];
      if (channel.ground_truth || channel.role == Role::setpoint)
        value = 0;
      else if (!std::isfinite(value))
        throw InputError(fmt::format("{}: channel {} is not a number at {:.3f} s; the gap needs every sample", name,
                                     channel.name, recording.time[k] - recording.time.front()));
    }
  }
  GapRun run;
  run.name = name;
  for (std::size_t k = 0; k + segment <= recording.rows(); k += segment) run.restarts.push_back(k);
  run.recording = std::move(recording);
  return run;
}

ResidualModel::ResidualModel(const Datasheet& sheet, std::vector<GapRun> runs, std::size_t segment)
    : sheet_(sheet), runs_(std::move(runs)), segment_(segment) {
  for (std::size_t c = 0; c < sheet_.channels.size(); ++c) {
    const Channel& channel = sheet_.channels[c];
    if (channel.role != Role::output || channel.ground_truth) continue;
    outputs_.push_back(static_cast<int>(c));
    double floor = 0;
    for (const GapRun& run : runs_) floor += noise_floor(run.recording, c) / static_cast<double>(runs_.size());
    noise_.push_back(std::max({floor, 0.3 * channel.noise_std, channel.resolution / std::sqrt(12.0),
                               1e-12 * (channel.maximum - channel.minimum)}));
  }
  for (const State& state : sheet_.states) {
    const int channel = find_channel(sheet_.channels, state.name);
    const bool shown = channel >= 0 && std::find(outputs_.begin(), outputs_.end(), channel) != outputs_.end();
    state_channel_.push_back(shown ? channel : -1);
  }
  const double factor = smoothing_factor();
  for (GapRun& run : runs_) {
    run.start_std.assign(state_channel_.size(), 0);
    for (std::size_t s = 0; s < state_channel_.size(); ++s)
      if (state_channel_[s] >= 0) {
        const auto output = std::find(outputs_.begin(), outputs_.end(), state_channel_[s]) - outputs_.begin();
        run.start_std[s] = factor * noise_[static_cast<std::size_t>(output)];
      }
    run.start_states.clear();
    for (const std::size_t row : run.restarts)
      for (const int channel : state_channel_)
        run.start_states.push_back(channel < 0 ? std::nan("")
                                               : smoothed(run.recording, row, static_cast<std::size_t>(channel)));
  }
}

Eigen::MatrixXf ResidualModel::simulate(const GapModel& model, const GapRun& run,
                                        const std::vector<std::size_t>& restarts,
                                        const std::vector<double>& starts) const {
  SimulationSetup setup;
  setup.parameters = model.parameters;
  setup.effects = model.effects;
  setup.noise = false;
  DrivenModel driven(sheet_, setup);
  const auto rows = run.recording.rows();
  Eigen::MatrixXf result(static_cast<Eigen::Index>(rows), static_cast<Eigen::Index>(outputs_.size()));
  driven.run(run.recording, 0, rows, restarts, starts.data(), [&](std::size_t k, const double* channels) {
    const double* measured = run.recording.row(k);
    for (std::size_t i = 0; i < outputs_.size(); ++i) {
      const auto c = static_cast<std::size_t>(outputs_[i]);
      const Channel& channel = sheet_.channels[c];
      const double shown = std::clamp(channels[c], channel.minimum, channel.maximum);
      double r = (measured[c] - shown) / noise_[i];
      if (!std::isfinite(r)) r = kLargest;
      result(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(i)) =
          static_cast<float>(std::clamp(r, -kLargest, kLargest));
    }
  });
  return result;
}

Eigen::MatrixXf ResidualModel::residuals(const GapModel& model, std::size_t run) const {
  return simulate(model, runs_[run], runs_[run].restarts, runs_[run].start_states);
}

Eigen::MatrixXf ResidualModel::residuals(const GapModel& model, std::size_t run, std::size_t horizon) const {
  std::vector<std::size_t> restarts;
  std::vector<double> starts;
  for (std::size_t k = 0; k < runs_[run].recording.rows(); k += horizon) {
    restarts.push_back(k);
    for (const int channel : state_channel_)
      starts.push_back(channel < 0 ? std::nan("")
                                   : smoothed(runs_[run].recording, k, static_cast<std::size_t>(channel)));
  }
  return simulate(model, runs_[run], restarts, starts);
}

std::vector<Eigen::MatrixXf> ResidualModel::start_sensitivity(const GapModel& model, std::size_t index) const {
  const GapRun& run = runs_[index];
  std::vector<Eigen::MatrixXf> result;
  for (std::size_t s = 0; s < state_channel_.size(); ++s) {
    if (state_channel_[s] < 0) continue;
    // Central difference over one standard error: the sensitivity per standard error.
    std::vector<double> plus = run.start_states, minus = run.start_states;
    for (std::size_t i = s; i < plus.size(); i += state_channel_.size()) {
      plus[i] += run.start_std[s];
      minus[i] -= run.start_std[s];
    }
    result.push_back((simulate(model, run, run.restarts, plus) - simulate(model, run, run.restarts, minus)) * 0.5f);
  }
  return result;
}

}  // namespace faultline
