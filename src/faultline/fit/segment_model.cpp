#include "faultline/fit/segment_model.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>

#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kThirdDifferenceVariance = 20;  // of unit white noise: 1 + 9 + 9 + 1
constexpr double kMedianToSigma = 1.4826;

struct Moments {  // of the offsets -reach..reach
  std::ptrdiff_t reach;
  double zeroth = 0, second = 0, fourth = 0;
  explicit Moments(std::size_t half_width) : reach(static_cast<std::ptrdiff_t>(half_width)) {
    for (std::ptrdiff_t i = -reach; i <= reach; ++i) {
      const double square = static_cast<double>(i * i);
      zeroth += 1;
      second += square;
      fourth += square * square;
    }
  }
};

struct Smooth {
  double value = 0;
  double misfit = 0;  // root mean square of what the quadratic leaves
};

// Centre of the least-squares quadratic over 2 reach + 1 samples; near the ends, the mean of the nearest.
Smooth smoothed(const Recording& recording, std::size_t row, std::size_t column, const Moments& moments) {
  const auto centre = static_cast<std::ptrdiff_t>(row), rows = static_cast<std::ptrdiff_t>(recording.rows());
  const auto at = [&](std::ptrdiff_t k) { return recording.at(static_cast<std::size_t>(k), column); };
  double sum = 0, first = 0, second = 0, square = 0;
  if (centre < moments.reach || centre + moments.reach >= rows) {
    const std::ptrdiff_t low = std::max<std::ptrdiff_t>(0, centre - 1), high = std::min(rows - 1, centre + 1);
    for (std::ptrdiff_t k = low; k <= high; ++k) sum += at(k);
    return {sum / static_cast<double>(high - low + 1), 0};
  }
  const double origin = at(centre);  // so that squares lose no digits
  for (std::ptrdiff_t i = -moments.reach; i <= moments.reach; ++i) {
    const double y = at(centre + i) - origin, x = static_cast<double>(i);
    sum += y;
    first += x * y;
    second += x * x * y;
    square += y * y;
  }
  const double determinant = moments.zeroth * moments.fourth - moments.second * moments.second;
  const double value = (moments.fourth * sum - moments.second * second) / determinant;
  const double bend = (moments.zeroth * second - moments.second * sum) / determinant;
  const double left = square - value * sum - first * first / moments.second - bend * second;
  return {origin + value, std::sqrt(std::max(0.0, left) / (moments.zeroth - 3))};
}

double smoothed_error(const Moments& moments) {  // per unit noise
  return std::sqrt(moments.fourth / (moments.zeroth * moments.fourth - moments.second * moments.second));
}

double third_difference_noise(const Recording& r, std::size_t column) {
  std::vector<double> sizes;
  for (std::size_t k = 3; k < r.rows(); ++k)
    sizes.push_back(
        std::abs(r.at(k, column) - 3 * r.at(k - 1, column) + 3 * r.at(k - 2, column) - r.at(k - 3, column)));
  if (sizes.empty()) return 0;
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return *middle * kMedianToSigma / std::sqrt(kThirdDifferenceVariance);
}

double smallest_noise(const Channel& channel, const SegmentOptions& options) {
  return std::max({options.least_noise_fraction * channel.noise_std, channel.resolution / std::sqrt(12.0),
                   1e-9 * (channel.maximum - channel.minimum)});
}

}  // namespace

SegmentModel::SegmentModel(const Datasheet& sheet, std::size_t segment, const SegmentOptions& options)
    : sheet_(sheet), segment_(segment), options_(options) {
  for (std::size_t c = 0; c < sheet_.channels.size(); ++c)
    if (sheet_.channels[c].role == Role::output && !sheet_.channels[c].ground_truth)
      outputs_.push_back(static_cast<int>(c));
  for (const int output : outputs_) {
    const Channel& channel = sheet_.channels[static_cast<std::size_t>(output)];
    noise_.push_back(std::max(channel.noise_std, smallest_noise(channel, options_)));
  }
  for (const State& state : sheet_.states) {
    const auto place = std::find(outputs_.begin(), outputs_.end(), state.channel);
    shown_by_.push_back(place == outputs_.end() ? -1 : state.channel);
    at_.push_back(static_cast<std::size_t>(place - outputs_.begin()));
  }
}

SegmentedRun SegmentModel::prepare(const std::string& name, Recording recording) const {
  if (recording.rows() < 2 * segment_)
    throw InputError(fmt::format("{}: {} samples are too few; at least {} are needed ({:g} s)", name, recording.rows(),
                                 2 * segment_, static_cast<double>(2 * segment_) * sheet_.sample_period));
  for (std::size_t k = 1; k < recording.rows(); ++k) {
    const double dt = recording.time[k] - recording.time[k - 1];
    if (std::abs(dt - sheet_.sample_period) > options_.period_error_fraction * sheet_.sample_period)
      throw InputError(fmt::format(
          "{}: {:g} s between the samples at {:.3f} s, the rig has {:g} s; cut the run there or resample it", name, dt,
          recording.time[k] - recording.time.front(), sheet_.sample_period));
  }
  for (std::size_t c = 0; c < sheet_.channels.size(); ++c) {
    const Channel& channel = sheet_.channels[c];
    for (std::size_t k = 0; k < recording.rows(); ++k) {
      double& value = recording.values[k * recording.columns() + c];
      if (channel.ground_truth || channel.role == Role::setpoint)
        value = 0;
      else if (!std::isfinite(value))
        throw InputError(fmt::format("{}: channel {} is not a number at {:.3f} s; cut the run there", name,
                                     channel.name, recording.time[k] - recording.time.front()));
    }
  }
  const Moments moments(options_.start_half_width_samples);
  SegmentedRun run;
  run.name = name;
  for (std::size_t k = 0; k + segment_ <= recording.rows(); k += segment_) {
    run.restarts.push_back(k);
    for (std::size_t s = 0; s < shown_by_.size(); ++s) {
      if (shown_by_[s] < 0) {
        run.starts.push_back(std::nan(""));
        run.start_errors.push_back(0);
        continue;
      }
      const Smooth smooth = smoothed(recording, k, static_cast<std::size_t>(shown_by_[s]), moments);
      const double own = smoothed_error(moments) * noise_[at_[s]];
      // What a quadratic cannot follow (a jump nearby) is an error of the start of its own size.
      const double excess = std::max(
          0.0, smooth.misfit * smooth.misfit - options_.start_misfit_variances * noise_[at_[s]] * noise_[at_[s]]);
      run.starts.push_back(smooth.value);
      run.start_errors.push_back(std::sqrt(own * own + excess));
    }
  }
  run.recording = std::move(recording);
  return run;
}

std::vector<double> SegmentModel::noise(const std::vector<SegmentedRun>& runs) const {
  std::vector<double> result;
  for (const int output : outputs_) {
    double sum = 0;
    for (const SegmentedRun& run : runs)
      sum += third_difference_noise(run.recording, static_cast<std::size_t>(output)) / static_cast<double>(runs.size());
    result.push_back(std::max(sum, smallest_noise(sheet_.channels[static_cast<std::size_t>(output)], options_)));
  }
  return result;
}

Eigen::MatrixXf SegmentModel::simulate(const ModelChange& change, const SegmentedRun& run,
                                       const std::vector<double>& starts, const std::vector<double>& sigma,
                                       const Enough& enough) const {
  SimulationSetup setup;
  setup.parameters = change.parameters;
  setup.effects = change.effects;
  setup.noise = false;
  DrivenModel driven(sheet_, setup);
  const std::size_t rows = run.recording.rows();
  const double largest = options_.largest_residual_sigma;
  Eigen::MatrixXf result(static_cast<Eigen::Index>(rows), static_cast<Eigen::Index>(outputs_.size()));
  driven.run(run.recording, 0, rows, run.restarts, starts.data(), [&](std::size_t k, const double* channels) {
    const double* measured = run.recording.row(k);
    for (std::size_t i = 0; i < outputs_.size(); ++i) {
      const auto c = static_cast<std::size_t>(outputs_[i]);
      double r =
          (measured[c] - std::clamp(channels[c], sheet_.channels[c].minimum, sheet_.channels[c].maximum)) / sigma[i];
      if (!std::isfinite(r)) r = largest;
      result(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(i)) =
          static_cast<float>(std::clamp(r, -largest, largest));
    }
    return !enough || !enough(k, result);
  });
  return result;
}

Eigen::MatrixXf SegmentModel::residuals(const ModelChange& change, const SegmentedRun& run,
                                        const std::vector<double>& sigma) const {
  return simulate(change, run, run.starts, sigma);
}

Eigen::MatrixXf SegmentModel::residuals(const ModelChange& change, const SegmentedRun& run,
                                        const std::vector<double>& sigma, const Enough& enough) const {
  return simulate(change, run, run.starts, sigma, enough);
}

std::vector<Eigen::MatrixXf> SegmentModel::start_columns(const ModelChange& change, const SegmentedRun& run,
                                                         const std::vector<double>& sigma) const {
  std::vector<Eigen::MatrixXf> result;
  for (std::size_t s = 0; s < shown_by_.size(); ++s) {
    if (shown_by_[s] < 0) continue;
    std::vector<double> plus = run.starts, minus = run.starts;
    for (std::size_t i = s; i < plus.size(); i += shown_by_.size()) {
      plus[i] += run.start_errors[i];
      minus[i] -= run.start_errors[i];
    }
    result.push_back((simulate(change, run, plus, sigma) - simulate(change, run, minus, sigma)) * 0.5f);
  }
  return result;
}

Eigen::VectorXd SegmentModel::stacked(const Eigen::MatrixXf& residuals, std::size_t first_row) const {
  // The first row of a segment still shows where the one before it ended: it is left out.
  const auto rows = static_cast<Eigen::Index>(segment_) - 1;
  Eigen::VectorXd column(rows * residuals.cols());
  for (Eigen::Index i = 0; i < residuals.cols(); ++i)
    column.segment(i * rows, rows) =
        residuals.col(i).segment(static_cast<Eigen::Index>(first_row) + 1, rows).cast<double>();
  return column;
}

void SegmentModel::project(const Eigen::MatrixXd& starts, Eigen::MatrixXd& columns) {
  if (starts.cols() == 0) return;
  // (I + S S')^(-1/2) = I - U (1 - (1 + s^2)^(-1/2)) U' with S = U s V', from the small Gram matrix S'S = V s^2 V'.
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(starts.transpose() * starts);
  const Eigen::MatrixXd inside = eigen.eigenvectors().transpose() * (starts.transpose() * columns);
  Eigen::VectorXd factor(eigen.eigenvalues().size());
  for (Eigen::Index i = 0; i < factor.size(); ++i) {
    const double square = std::max(0.0, eigen.eigenvalues()[i]);
    factor[i] = square < 1e-12 ? 0 : (1 - 1 / std::sqrt(1 + square)) / square;
  }
  columns.noalias() -= starts * (eigen.eigenvectors() * (factor.asDiagonal() * inside));
}

}  // namespace faultline
