#include "faultline/segments/smoothing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include <Eigen/QR>

#include "faultline/numerics/quantiles.h"

namespace faultline {
namespace {

constexpr double kThirdDifferenceVariance = 20;  // of unit white noise: 1 + 9 + 9 + 1
constexpr double kMedianOfNormal = 0.67449;      // of |x|, x normal

constexpr std::array<std::size_t, 3> kCourseHalfWidths = {48, 24, 12};  // samples, of smoothed_course()

// Noise that a resampling has mixed (resampled_noise): lags of its third differences that are looked at, and of itself
// that it may have; rows that tell; standard deviations beyond which a difference is a jump; what the fit may leave, as
// a fraction of the differences' variance; least density of its spectrum that is still called white (over 0.34 in 1033
// of 1035 channels of simulated recordings; at most 0.15 between samples a third of a period off) and the level over
// that of third differences from which it counts.
constexpr int kLags = 6, kMixed = 2;
constexpr std::size_t kRowsThatTell = 500;
constexpr double kJump = 4, kLeftFraction = 0.04, kWhiteDensity = 0.3, kResampledRatio = 1.3;

struct Window {  // moments of the offsets -width .. width
  std::ptrdiff_t width;
  double s0 = 0, s2 = 0, s4 = 0;
  explicit Window(std::size_t half_width) : width(static_cast<std::ptrdiff_t>(half_width)) {
    for (std::ptrdiff_t i = -width; i <= width; ++i) {
      const double x2 = static_cast<double>(i * i);
      s0 += 1;
      s2 += x2;
      s4 += x2 * x2;
    }
  }
  double determinant() const { return s0 * s4 - s2 * s2; }
  // Weight of the sample at an offset in the value at the centre.
  double weight(std::ptrdiff_t i) const { return (s4 - s2 * static_cast<double>(i * i)) / determinant(); }
};

// The quadratic over the samples around `centre` as it stands at `row`.
struct Quadratic {
  Smoothed at;
  double misfit = std::numeric_limits<double>::infinity();  // sum of squares; infinite where a sample measures nothing
};

Quadratic quadratic(const Recording& recording, std::size_t row, std::size_t centre, const Window& window,
                    std::size_t column, double noise) {
  const Channel& channel = recording.channels[column];
  const auto at = [&](std::ptrdiff_t i) {
    return recording.at(static_cast<std::size_t>(static_cast<std::ptrdiff_t>(centre) + i), column);
  };
  double value = 0, slope = 0, against = 0;
  for (std::ptrdiff_t i = -window.width; i <= window.width; ++i) {
    if (!measures(channel, at(i))) return {};
    value += window.weight(i) * at(i);
    slope += static_cast<double>(i) * at(i) / window.s2;
  }
  for (std::ptrdiff_t i = -window.width; i <= window.width; ++i)
    against += static_cast<double>(i * i) * (at(i) - value);
  const double curvature = against / window.s4;
  Quadratic result;
  result.misfit = 0;
  for (std::ptrdiff_t i = -window.width; i <= window.width; ++i) {
    const double x = static_cast<double>(i);
    result.misfit += std::pow(at(i) - value - slope * x - curvature * x * x, 2);
  }
  const double x = static_cast<double>(row) - static_cast<double>(centre), d = window.determinant();
  result.at = {value + slope * x + curvature * x * x,
               noise * std::sqrt(window.s4 / d + x * x * (1 / window.s2 + (window.s0 * x * x - 2 * window.s2) / d)),
               slope + 2 * curvature * x, noise * std::sqrt(1 / window.s2 + 4 * x * x * window.s0 / d), curvature};
  return result;
}

// What a reading that is missing would have been: the quadratic over the nearest window that describes the signal and
// ends beside what is missing.
std::optional<Smoothed> from_beside(const Recording& recording, std::size_t row, std::size_t column, std::size_t first,
                                    std::size_t last, double noise, std::size_t widest, const SegmentOptions& options) {
  std::optional<Smoothed> best;
  for (const std::size_t w : options.start_half_width_samples) {
    if (w > widest || last - first < 2 * w + 1) continue;
    const Window window(w);
    for (std::size_t missing = 1; missing <= w; ++missing)
      for (const bool after : {true, false}) {
        const std::size_t away = w + missing;
        if (after ? row + away + w >= last : row < first + away + w) continue;
        const Quadratic q = quadratic(recording, row, after ? row + away : row - away, window, column, noise);
        if (q.misfit < options.start_misfit_variances * noise * noise * (window.s0 - 3) &&
            (!best || q.at.std < best->std))
          best = q.at;
      }
  }
  return best;
}

}  // namespace

bool measures(const Channel& channel, double value) { return value > channel.minimum && value < channel.maximum; }

Smoothed smoothed(const Recording& recording, std::size_t row, std::size_t column, std::size_t first, std::size_t last,
                  double noise, std::size_t widest, const SegmentOptions& options) {
  const Channel& channel = recording.channels[column];
  const auto fits = [&](const Quadratic& q, const Window& window) {
    return q.misfit < options.start_misfit_variances * noise * noise * (window.s0 - 3);
  };
  for (const std::size_t w : options.start_half_width_samples) {
    if (w > widest || row < first + w || row + w >= last) continue;
    const Window window(w);
    const Quadratic q = quadratic(recording, row, row, window, column, noise);
    if (fits(q, window)) return q.at;
  }
  const double value = recording.at(row, column);
  const std::size_t before = row > first ? row - 1 : row, after = row + 1 < last ? row + 1 : row;
  const auto rows = static_cast<double>(std::max<std::size_t>(1, after - before));
  Smoothed result{measures(channel, value) ? value : std::nan(""), noise,
                  (recording.at(after, column) - recording.at(before, column)) / rows, noise * std::sqrt(2.0) / rows,
                  0};
  for (const std::size_t w : options.start_half_width_samples) {
    if (w > widest || last - first < 2 * w + 1) continue;
    const Window window(w);
    Quadratic best;
    for (const std::size_t centre : {std::max(row, first + 2 * w) - w, row + w})
      if (const std::size_t c = std::min(centre, last - 1 - w); std::max(c, row) - std::min(c, row) <= w) {
        Quadratic q = quadratic(recording, row, c, window, column, noise);
        if (fits(q, window) && q.misfit < best.misfit) best = q;
      }
    if (!std::isfinite(best.misfit) || best.at.slope_std > result.slope_std) continue;
    result.slope = best.at.slope;
    result.slope_std = best.at.slope_std;
    break;
  }
  if (!std::isfinite(value)) {
    if (const std::optional<Smoothed> beside = from_beside(recording, row, column, first, last, noise, widest, options))
      return *beside;
  }
  return result;
}

Smoothed smoothed_course(const Recording& recording, std::size_t row, std::size_t column, std::size_t first,
                         std::size_t last, double noise, std::size_t widest, const SegmentOptions& options) {
  for (const std::size_t w : kCourseHalfWidths) {
    if (w > widest || last - first < 2 * w + 1) continue;
    const Window window(w);
    const double freedom = window.s0 - 3, scatter = std::sqrt(2 / freedom);
    Quadratic q = quadratic(recording, row, std::clamp(row, first + w, last - 1 - w), window, column, noise);
    if (!(q.misfit < (1 + scatter) * noise * noise * freedom)) continue;
    q.at.slope_std = std::hypot(q.at.slope_std, noise / static_cast<double>(w));
    return q.at;
  }
  return smoothed(recording, row, column, first, last, noise, widest, options);
}

void smooth_inputs(const Datasheet& sheet, Recording& recording, std::size_t first, std::size_t last,
                   std::size_t widest, const std::vector<double>& noise, const SegmentOptions& options) {
  for (std::size_t c = 0; c < sheet.channels.size(); ++c) {
    if (sheet.channels[c].role != Role::input || sheet.channels[c].ground_truth || noise[c] <= 0) continue;
    for (const std::size_t w : options.input_half_width_samples) {  // the widest that takes only noise away
      if (w > widest || last - first < 2 * w + 1) continue;
      const Window window(w);
      std::vector<double> smooth(last - first);
      double taken = 0;
      for (std::size_t k = first; k < last; ++k) {
        double& to = smooth[k - first];
        to = recording.at(k, c);
        if (k < first + w || k + w >= last) continue;
        double sum = 0;
        for (std::size_t i = 0; i <= 2 * w; ++i)
          sum += window.weight(static_cast<std::ptrdiff_t>(i) - window.width) * recording.at(k - w + i, c);
        to = sum;
        taken += std::pow(recording.at(k, c) - sum, 2);
      }
      const double expected = (1 - window.weight(0)) * noise[c] * noise[c] * static_cast<double>(last - first - 2 * w);
      if (taken > options.input_removed_variance_ratio * expected) continue;
      for (std::size_t k = first; k < last; ++k) recording.values[k * recording.columns() + c] = smooth[k - first];
      break;
    }
  }
}

namespace {

// Covariance of the weights of a third difference, at a lag.
double weights_covariance(int lag) {
  constexpr std::array<double, 4> kCovariance = {kThirdDifferenceVariance, -15, 6, -1};
  const auto k = static_cast<std::size_t>(std::abs(lag));
  return k < kCovariance.size() ? kCovariance[k] : 0;
}

// Least density over the frequencies of noise with these covariances at lags 0, 1, ..., over that of white noise.
double least_density(const Eigen::VectorXd& covariances) {
  constexpr int kFrequencies = 32;
  double least = std::numeric_limits<double>::infinity();
  for (int f = 0; f <= kFrequencies; ++f) {
    double density = covariances[0];
    for (Eigen::Index j = 1; j < covariances.size(); ++j)
      density += 2 * covariances[j] * std::cos(static_cast<double>(j) * f * M_PI / kFrequencies);
    least = std::min(least, density);
  }
  return least / covariances[0];
}

// See the header; 0 where the noise is not of that kind. `differences`: not a number where a sample measures nothing.
double resampled_noise(std::vector<double> differences, double white) {
  const double most = kJump * white * std::sqrt(kThirdDifferenceVariance);
  for (double& d : differences) d = std::isfinite(d) ? std::clamp(d, -most, most) : d;
  Eigen::VectorXd seen(kLags + 1);
  Eigen::MatrixXd mixed = Eigen::MatrixXd::Zero(kLags + 1, kMixed + 1);
  for (int lag = 0; lag <= kLags; ++lag) {
    double sum = 0;
    std::size_t count = 0;
    for (auto k = static_cast<std::size_t>(lag); k < differences.size(); ++k) {
      const double product = differences[k] * differences[k - static_cast<std::size_t>(lag)];
      if (!std::isfinite(product)) continue;
      sum += product;
      ++count;
    }
    if (count < kRowsThatTell) return 0;
    seen[lag] = sum / static_cast<double>(count);
    mixed(lag, 0) = weights_covariance(lag);
    for (int j = 1; j <= kMixed; ++j) mixed(lag, j) = weights_covariance(lag - j) + weights_covariance(lag + j);
  }
  const Eigen::VectorXd covariances = mixed.colPivHouseholderQr().solve(seen);
  const double left = (mixed * covariances - seen).cwiseAbs().maxCoeff();
  const double level = std::sqrt(std::max(covariances[0], 0.0));
  const bool is_mixed =
      left < kLeftFraction * seen[0] && level > kResampledRatio * white && least_density(covariances) < kWhiteDensity;
  return is_mixed ? level : 0;
}

}  // namespace

double noise_floor(const Recording& recording, std::size_t column) {
  const Channel& channel = recording.channels[column];
  std::vector<double> differences, sizes;
  differences.reserve(recording.rows());
  for (std::size_t k = 3; k < recording.rows(); ++k) {
    const double a = recording.at(k, column), b = recording.at(k - 1, column), c = recording.at(k - 2, column),
                 d = recording.at(k - 3, column);
    const bool good = measures(channel, a) && measures(channel, b) && measures(channel, c) && measures(channel, d);
    differences.push_back(good ? a - 3 * b + 3 * c - d : std::nan(""));
    if (good) sizes.push_back(std::abs(differences.back()));
  }
  if (sizes.empty()) return 0;
  const double white = median(std::move(sizes)) / kMedianOfNormal / std::sqrt(kThirdDifferenceVariance);
  return std::max(white, resampled_noise(std::move(differences), white));
}

}  // namespace faultline
