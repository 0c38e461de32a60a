#include "faultline/gap/spectral_lines.h"

#include <algorithm>
#include <cmath>
#include <complex>

#include <unsupported/Eigen/FFT>

namespace faultline {
namespace {

constexpr double kTwoPi = 6.283185307179586;

double longest(const std::vector<Eigen::MatrixXf>& residuals, const std::vector<double>& periods) {  // s
  double duration = 0;
  for (std::size_t r = 0; r < residuals.size(); ++r)
    duration = std::max(duration, static_cast<double>(residuals[r].rows()) * periods[r]);
  return duration;
}

std::size_t power_of_two_above(double size) {
  std::size_t result = 1;
  while (static_cast<double>(result) < size) result *= 2;
  return result;
}

// Adds the power of one run over frequencies k spacing.
void add_power(const Eigen::MatrixXf& run, double period, double spacing, std::vector<double>& power) {
  const std::size_t size = power_of_two_above(0.999 / (spacing * period));
  const double ratio = spacing * period * static_cast<double>(size);  // of the spacings; 1 or more
  Eigen::FFT<double> fft;
  std::vector<double> signal;
  std::vector<std::complex<double>> spectrum;
  for (Eigen::Index column = 0; column < run.cols(); ++column) {
    Eigen::VectorXd values = run.col(column).cast<double>();
    for (Eigen::Index k = 0; k < values.size(); ++k)  // Hann's window: a strong line must not make lines beside itself
      values[k] *= 0.5 - 0.5 * std::cos(kTwoPi * (static_cast<double>(k) + 0.5) / static_cast<double>(values.size()));
    const double scale = 1 / std::max(1e-12, values.norm());  // one channel far off must not hide the others
    signal.assign(size, 0.0);
    for (Eigen::Index k = 0; k < values.size(); ++k) signal[static_cast<std::size_t>(k)] = scale * values[k];
    fft.fwd(spectrum, signal);
    for (std::size_t k = 0; k < power.size(); ++k) {
      const auto at = static_cast<std::size_t>(std::lround(ratio * static_cast<double>(k)));
      if (at <= size / 2) power[k] += std::norm(spectrum[at]);
    }
  }
}

}  // namespace

std::vector<double> spectral_lines(const std::vector<Eigen::MatrixXf>& residuals, const std::vector<double>& periods,
                                   double low, double high, const GapOptions::Spectrum& options) {
  const double fastest = *std::min_element(periods.begin(), periods.end());
  const std::size_t size =
      power_of_two_above(static_cast<double>(options.padding_ratio) * longest(residuals, periods) / fastest);
  const double spacing = 1 / (static_cast<double>(size) * fastest);
  std::vector<double> power(size / 2 + 1, 0.0);
  double spectra = 0;
  for (std::size_t r = 0; r < residuals.size(); ++r) {
    add_power(residuals[r], periods[r], spacing, power);
    spectra += static_cast<double>(residuals[r].cols());
  }
  // A sum of so many exponentials exceeds so many times its mean only with probability exp(-rarity) (Laurent and
  // Massart 2000).
  const double least =
      1 + std::sqrt(2 * options.rarity_log_likelihood / spectra) + options.rarity_log_likelihood / spectra;
  const auto first = std::max<std::size_t>(1, static_cast<std::size_t>(std::ceil(low / spacing)));
  const auto last = std::min(power.size() - 2, static_cast<std::size_t>(high / spacing));
  std::vector<std::pair<double, double>> peaks;  // (how far it stands out, frequency)
  std::vector<double> around;
  const std::size_t neighbours = options.neighbour_grid_points;
  for (std::size_t k = first; k <= last; ++k) {
    if (power[k] < power[k - 1] || power[k] < power[k + 1]) continue;
    around.assign(power.begin() + static_cast<std::ptrdiff_t>(k - std::min(k, neighbours)),
                  power.begin() + static_cast<std::ptrdiff_t>(std::min(power.size(), k + neighbours + 1)));
    const auto middle = around.begin() + static_cast<std::ptrdiff_t>(around.size() / 2);
    std::nth_element(around.begin(), middle, around.end());
    const double contrast = power[k] / std::max(*middle, 1e-300);
    if (contrast > least) peaks.emplace_back(contrast, static_cast<double>(k) * spacing);
  }
  std::sort(peaks.rbegin(), peaks.rend());
  std::vector<double> lines;
  const double apart = options.line_distance_resolutions / longest(residuals, periods);
  for (const auto& [contrast, frequency] : peaks) {
    if (lines.size() == options.lines) break;
    if (std::all_of(lines.begin(), lines.end(), [&](double f) { return std::abs(f - frequency) > apart; }))
      lines.push_back(frequency);
  }
  return lines;
}

std::vector<Candidate> at_lines(const std::vector<Candidate>& candidates, const std::vector<Eigen::MatrixXf>& residuals,
                                const std::vector<double>& periods, const GapOptions::Spectrum& options) {
  const double width = options.line_half_width_resolutions / longest(residuals, periods);
  std::vector<Candidate> result;
  for (const Candidate& candidate : candidates) {
    const std::size_t at = find_effect_type(candidate.effect.effect)->with_unit("Hz");
    if (at >= candidate.bounds.size() || candidate.bounds[at].minimum >= candidate.bounds[at].maximum) {
      result.push_back(candidate);
      continue;
    }
    const Bounds range = candidate.bounds[at];
    for (const double line : spectral_lines(residuals, periods, range.minimum, range.maximum, options)) {
      result.push_back(candidate);
      result.back().bounds[at] = {std::max(range.minimum, line - width), std::min(range.maximum, line + width)};
    }
  }
  return result;
}

}  // namespace faultline
