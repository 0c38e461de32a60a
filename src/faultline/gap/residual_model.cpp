#include "faultline/gap/residual_model.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Cholesky>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kThirdDifferenceVariance = 20;  // of unit white noise: 1 + 9 + 9 + 1
constexpr double kLeastNoise = 1e-12;            // of a channel's range: a guard where the noise is 0

// Weights that give the value at the centre of a quadratic fitted over 2 width + 1 samples (Savitzky-Golay).
std::vector<double> quadratic_weights(std::size_t half_width) {
  const int width = static_cast<int>(half_width);
  double s0 = 0, s2 = 0, s4 = 0;
  for (int i = -width; i <= width; ++i) {
    const double x2 = static_cast<double>(i * i);
    s0 += 1;
    s2 += x2;
    s4 += x2 * x2;
  }
  std::vector<double> weights;
  for (int i = -width; i <= width; ++i) weights.push_back((s4 - s2 * static_cast<double>(i * i)) / (s0 * s4 - s2 * s2));
  return weights;
}

// The signal without its noise at a row: a quadratic over as many samples as it describes; where the signal bends too
// fast (a spool that jumps), the sample itself.
double smoothed(const Recording& recording, std::size_t row, std::size_t column, double noise,
                const GapOptions::Residuals& options) {
  for (const std::size_t w : options.start_half_width_samples) {
    const double width = static_cast<double>(w);
    if (row < w || row + w >= recording.rows()) continue;
    const std::vector<double> weights = quadratic_weights(w);
    double value = 0, slope = 0, s2 = 0, s4 = 0, against = 0;
    for (std::size_t i = 0; i <= 2 * w; ++i) {
      const double x = static_cast<double>(i) - width, y = recording.at(row - w + i, column);
      value += weights[i] * y;
      slope += x * y;
      s2 += x * x;
    }
    slope /= s2;
    for (std::size_t i = 0; i <= 2 * w; ++i) {
      const double x = static_cast<double>(i) - width, y = recording.at(row - w + i, column);
      against += x * x * (y - value);
      s4 += x * x * x * x;
    }
    const double curvature = against / s4;
    double misfit = 0;
    for (std::size_t i = 0; i <= 2 * w; ++i) {
      const double x = static_cast<double>(i) - width, y = recording.at(row - w + i, column);
      misfit += std::pow(y - value - slope * x - curvature * x * x, 2);
    }
    if (misfit < options.start_misfit_variances * noise * noise * static_cast<double>(2 * w - 2)) return value;
  }
  return recording.at(row, column);
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
  return *middle / 0.67449 / std::sqrt(kThirdDifferenceVariance);
}

void smooth_inputs(const Datasheet& sheet, Recording& recording, const GapOptions::Residuals& options) {
  for (std::size_t c = 0; c < sheet.channels.size(); ++c) {
    if (sheet.channels[c].role != Role::input || sheet.channels[c].ground_truth) continue;
    const double noise = noise_floor(recording, c);
    for (const std::size_t w : options.input_half_width_samples) {  // the widest that takes only noise away
      const std::vector<double> weights = quadratic_weights(w);
      if (noise <= 0 || recording.rows() < 2 * w + 1) break;
      std::vector<double> smooth(recording.rows());
      double taken = 0;
      for (std::size_t k = 0; k < recording.rows(); ++k) {
        smooth[k] = recording.at(k, c);
        if (k < w || k + w >= recording.rows()) continue;
        double sum = 0;
        for (std::size_t i = 0; i <= 2 * w; ++i) sum += weights[i] * recording.at(k - w + i, c);
        smooth[k] = sum;
        taken += std::pow(recording.at(k, c) - sum, 2);
      }
      const double expected = (1 - weights[w]) * noise * noise * static_cast<double>(recording.rows() - 2 * w);
      if (taken > options.input_removed_variance_ratio * expected) continue;
      for (std::size_t k = 0; k < recording.rows(); ++k) recording.values[k * recording.columns() + c] = smooth[k];
      break;
    }
  }
}

GapRun prepare_run(const Datasheet& sheet, const std::string& name, Recording recording, std::size_t segment,
                   const GapOptions::Residuals& options) {
  if (recording.rows() < 2 * segment)
    throw InputError(fmt::format("{}: {} samples are too few; a gap needs at least {} ({:g} s)", name, recording.rows(),
                                 2 * segment, static_cast<double>(2 * segment) * sheet.sample_period));
  for (std::size_t k = 1; k < recording.rows(); ++k) {
    const double dt = recording.time[k] - recording.time[k - 1];
    if (std::abs(dt - sheet.sample_period) > options.period_error_fraction * sheet.sample_period)
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
  smooth_inputs(sheet, recording, options);
  GapRun run;
  run.name = name;
  for (std::size_t k = 0; k + segment <= recording.rows(); k += segment) run.restarts.push_back(k);
  run.recording = std::move(recording);
  return run;
}

ResidualModel::ResidualModel(const Datasheet& sheet, std::vector<GapRun> runs, std::size_t segment,
                             const GapOptions& options)
    : sheet_(sheet), runs_(std::move(runs)), segment_(segment), options_(options) {
  for (std::size_t c = 0; c < sheet_.channels.size(); ++c) {
    const Channel& channel = sheet_.channels[c];
    if (channel.role != Role::output || channel.ground_truth) continue;
    outputs_.push_back(static_cast<int>(c));
    double floor = 0;
    for (const GapRun& run : runs_) floor += noise_floor(run.recording, c) / static_cast<double>(runs_.size());
    noise_.push_back(
        std::max({floor, options_.residuals.least_noise_fraction * channel.noise_std,
                  channel.resolution / std::sqrt(12.0), kLeastNoise * (channel.maximum - channel.minimum)}));
  }
  for (const State& state : sheet_.states) {
    const bool shown = std::find(outputs_.begin(), outputs_.end(), state.channel) != outputs_.end();
    state_channel_.push_back(shown ? state.channel : -1);
  }
  for (GapRun& run : runs_) {
    run.start_std.assign(state_channel_.size(), 0);
    for (std::size_t s = 0; s < state_channel_.size(); ++s)
      if (state_channel_[s] >= 0) {
        const auto output = std::find(outputs_.begin(), outputs_.end(), state_channel_[s]) - outputs_.begin();
        run.start_std[s] = options_.residuals.start_prior_sigma * noise_[static_cast<std::size_t>(output)];
      }
    run.start_states.clear();
    run.start_shift.assign(run.restarts.size() * state_channel_.size(), 0.0);
    for (const std::size_t row : run.restarts)
      for (const int channel : state_channel_) run.start_states.push_back(start_at(run, row, channel));
  }
}

double ResidualModel::start_at(const GapRun& run, std::size_t row, int channel) const {
  if (channel < 0) return std::nan("");
  const auto output = std::find(outputs_.begin(), outputs_.end(), channel) - outputs_.begin();
  return smoothed(run.recording, row, static_cast<std::size_t>(channel), noise_[static_cast<std::size_t>(output)],
                  options_.residuals);
}

Eigen::MatrixXf ResidualModel::simulate(const GapModel& model, const GapRun& run,
                                        const std::vector<std::size_t>& restarts,
                                        const std::vector<double>& starts) const {
  SimulationSetup setup;
  setup.parameters = model.parameters;
  setup.effects = model.effects;
  setup.noise = false;
  DrivenModel driven(sheet_, setup);
  const double largest = options_.residuals.largest_residual_sigma;
  const auto rows = run.recording.rows();
  Eigen::MatrixXf result(static_cast<Eigen::Index>(rows), static_cast<Eigen::Index>(outputs_.size()));
  driven.run(run.recording, 0, rows, restarts, starts.data(), [&](std::size_t k, const double* channels) {
    const double* measured = run.recording.row(k);
    for (std::size_t i = 0; i < outputs_.size(); ++i) {
      const auto c = static_cast<std::size_t>(outputs_[i]);
      const Channel& channel = sheet_.channels[c];
      const double shown = std::clamp(channels[c], channel.minimum, channel.maximum);
      double r = (measured[c] - shown) / noise_[i];
      if (!std::isfinite(r)) r = largest;
      result(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(i)) =
          static_cast<float>(std::clamp(r, -largest, largest));
    }
  });
  read_held_values(model, run, result);
  return result;
}

// What a stuck sensor holds is read from the recording: its simulated value has the error of the segment in which it
// stuck, for ever.
void ResidualModel::read_held_values(const GapModel& model, const GapRun& run, Eigen::MatrixXf& residuals) const {
  for (const EffectSpec& spec : model.effects) {
    if (spec.effect != "stuck" || sheet_.port(spec.port).kind != PortKind::sensor) continue;
    const int channel = sheet_.channel(sheet_.port(spec.port).channel);
    const auto output = std::find(outputs_.begin(), outputs_.end(), channel);
    if (output == outputs_.end()) continue;
    const double from = spec.parameters.front() + run.recording.time.front();
    const auto first = std::lower_bound(run.recording.time.begin(), run.recording.time.end(), from);
    auto held = residuals.col(output - outputs_.begin()).tail(run.recording.time.end() - first);
    if (held.size() > 0) held.array() -= held.mean();
  }
}

Eigen::MatrixXf ResidualModel::residuals(const GapModel& model, std::size_t run) const {
  Eigen::MatrixXf result = simulate(model, runs_[run], runs_[run].restarts, runs_[run].start_states);
  // The row of a restart still shows where the segment before it ended, which is not what this segment's states
  // explain.
  for (std::size_t g = 1; g < runs_[run].segments(); ++g)
    result.row(static_cast<Eigen::Index>(runs_[run].restarts[g])).setZero();
  return result;
}

Eigen::MatrixXf ResidualModel::residuals(const GapModel& model, std::size_t run, std::size_t horizon) const {
  std::vector<std::size_t> restarts;
  std::vector<double> starts;
  for (std::size_t k = 0; k < runs_[run].recording.rows(); k += horizon) {
    restarts.push_back(k);
    for (const int channel : state_channel_) starts.push_back(start_at(runs_[run], k, channel));
  }
  return simulate(model, runs_[run], restarts, starts);
}

std::vector<Eigen::MatrixXf> ResidualModel::start_sensitivity(const GapModel& model, std::size_t index) const {
  const GapRun& run = runs_[index];
  const Eigen::MatrixXf now = simulate(model, run, run.restarts, run.start_states);
  const double step = options_.residuals.start_difference_sigma;
  std::vector<Eigen::MatrixXf> result;
  for (std::size_t s = 0; s < state_channel_.size(); ++s) {
    if (state_channel_[s] < 0) continue;
    std::vector<double> moved = run.start_states;
    for (std::size_t i = s; i < moved.size(); i += state_channel_.size()) moved[i] += step * run.start_std[s];
    result.push_back((simulate(model, run, run.restarts, moved) - now) / static_cast<float>(step));
    for (std::size_t g = 1; g < run.segments(); ++g)
      result.back().row(static_cast<Eigen::Index>(run.restarts[g])).setZero();
  }
  return result;
}

Eigen::MatrixXd ResidualModel::start_shift(std::size_t index) const {
  const GapRun& run = runs_[index];
  const auto shown = std::count_if(state_channel_.begin(), state_channel_.end(), [](int c) { return c >= 0; });
  Eigen::MatrixXd result(static_cast<Eigen::Index>(run.segments()), shown);
  for (std::size_t g = 0; g < run.segments(); ++g) {
    Eigen::Index column = 0;
    for (std::size_t s = 0; s < state_channel_.size(); ++s)
      if (state_channel_[s] >= 0)
        result(static_cast<Eigen::Index>(g), column++) = run.start_shift[g * state_channel_.size() + s];
  }
  return result;
}

std::vector<Eigen::MatrixXf> ResidualModel::settle_starts(const GapModel& model, std::size_t index,
                                                          std::vector<Eigen::MatrixXf> known) {
  GapRun& run = runs_[index];
  const Eigen::MatrixXf before = residuals(model, index);
  std::vector<Eigen::MatrixXf> sensitivity = known.empty() ? start_sensitivity(model, index) : std::move(known);
  const Eigen::MatrixXd shift = start_shift(index);
  const double largest = options_.residuals.start_shift_limit_sigma;
  const std::vector<double> old_states = run.start_states, old_shift = run.start_shift;
  const auto length = static_cast<Eigen::Index>(segment_);
  const auto n = static_cast<Eigen::Index>(sensitivity.size());
  for (std::size_t g = 0; g < run.segments(); ++g) {
    const auto first = static_cast<Eigen::Index>(g) * length;
    const auto part = [&](const Eigen::MatrixXf& m) { return m.middleRows(first, length); };
    Eigen::MatrixXd information = Eigen::MatrixXd::Identity(n, n);
    Eigen::VectorXd gradient = shift.row(static_cast<Eigen::Index>(g)).transpose();
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto& column = sensitivity[static_cast<std::size_t>(i)];
      gradient[i] += static_cast<double>(part(column).cwiseProduct(part(before)).sum());
      for (Eigen::Index j = 0; j < n; ++j)
        information(i, j) +=
            static_cast<double>(part(column).cwiseProduct(part(sensitivity[static_cast<std::size_t>(j)])).sum());
    }
    const Eigen::VectorXd move = -information.ldlt().solve(gradient);
    Eigen::Index column = 0;
    for (std::size_t s = 0; s < state_channel_.size(); ++s) {
      if (state_channel_[s] < 0) continue;
      const std::size_t at = g * state_channel_.size() + s;
      const double to = std::clamp(old_shift[at] + move[column++], -largest, largest);
      run.start_states[at] += (to - old_shift[at]) * run.start_std[s];
      run.start_shift[at] = to;
    }
  }
  const Eigen::MatrixXf after = residuals(model, index);
  const Eigen::MatrixXd moved = start_shift(index);
  for (std::size_t g = 0; g < run.segments(); ++g) {
    const auto first = static_cast<Eigen::Index>(g) * length, row = static_cast<Eigen::Index>(g);
    if (static_cast<double>(after.middleRows(first, length).squaredNorm()) + moved.row(row).squaredNorm() <
        static_cast<double>(before.middleRows(first, length).squaredNorm()) + shift.row(row).squaredNorm())
      continue;
    for (std::size_t s = 0; s < state_channel_.size(); ++s) {
      run.start_states[g * state_channel_.size() + s] = old_states[g * state_channel_.size() + s];
      run.start_shift[g * state_channel_.size() + s] = old_shift[g * state_channel_.size() + s];
    }
  }
  return sensitivity;
}

}  // namespace faultline
