#include "faultline/gap/averaging.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <type_traits>

#include "faultline/attribution/candidates.h"
#include "faultline/gap/spectral_lines.h"
#include "faultline/numerics/quantiles.h"
#include "faultline/rig/rig.h"
#include "faultline/segments/even_rows.h"

namespace faultline {
namespace {

constexpr double kSlowest = 0.18;  // of the averages' rate: at it a mean is 5 % smaller than the swing
// A line that matters stands out far more than chance lets one of some ten thousand frequencies do, which would make
// all that follows take five times as long: this takes a seventh of the noise in one channel of 25 for 28 s at 1 kHz.
constexpr double kRarity = 40;
constexpr double kFarthest = 6;  // times the usual one, to which a deviation counts: a step is no line

// What an output's readings are off the mean around them, of twice as many rows to each side as are averaged: what
// swings stays, motion does not.
Eigen::VectorXf fast_part(const Recording& r, std::size_t column, std::size_t rows) {
  const std::size_t side = 2 * rows, all = r.rows();
  std::vector<double> sum(all + 1, 0), count(all + 1, 0);
  for (std::size_t k = 0; k < all; ++k) {
    const bool there = std::isfinite(r.at(k, column));
    sum[k + 1] = sum[k] + (there ? r.at(k, column) : 0);
    count[k + 1] = count[k] + there;
  }
  std::vector<double> sizes;
  Eigen::VectorXf result = Eigen::VectorXf::Zero(static_cast<Eigen::Index>(all));
  for (std::size_t k = side; k + side < all; ++k) {
    if (!std::isfinite(r.at(k, column))) continue;
    const std::size_t first = k - side, last = k + side + 1;
    const double off = r.at(k, column) - (sum[last] - sum[first]) / (count[last] - count[first]);
    result[static_cast<Eigen::Index>(k)] = static_cast<float>(off);
    sizes.push_back(std::abs(off));
  }
  if (sizes.empty()) return result;
  const auto most = static_cast<float>(kFarthest * median(std::move(sizes)));
  return result.cwiseMax(-most).cwiseMin(most);
}

std::size_t rows_of_one(const Datasheet& sheet, const Recording& recording, const GapOptions& options) {
  const RigType* type = find_rig_type(sheet.rig);
  if (!type || recording.rows() < 2) return 1;
  const double period = fitted_period(sheet, recording);
  const auto most = static_cast<std::size_t>(type->shown_period / period + 1e-6);
  std::size_t rows = most < 3 ? 1 : most - (most + 1) % 2;
  if (rows == 1) return 1;
  std::vector<std::size_t> outputs;
  for (std::size_t c = 0; c < sheet.channels.size(); ++c)
    if (sheet.channels[c].role == Role::output && !sheet.channels[c].ground_truth) outputs.push_back(c);
  Eigen::MatrixXf fast(static_cast<Eigen::Index>(recording.rows()), static_cast<Eigen::Index>(outputs.size()));
  for (std::size_t i = 0; i < outputs.size(); ++i)
    fast.col(static_cast<Eigen::Index>(i)) = fast_part(recording, outputs[i], rows);
  double low = std::numeric_limits<double>::infinity(), high = 0;  // Hz, of what swings
  for (const Candidate& candidate : candidates(sheet, {})) {
    const std::size_t frequency = find_effect_type(candidate.effect.effect)->with_unit("Hz");
    if (frequency >= candidate.bounds.size()) continue;
    low = std::min(low, candidate.bounds[frequency].minimum);
    high = std::max(high, candidate.bounds[frequency].maximum);
  }
  GapOptions::Spectrum certain = options.spectrum;
  certain.rarity_log_likelihood = kRarity;
  const auto swings = [&] {
    const double above = std::max(low, kSlowest / (static_cast<double>(rows) * period));
    return above < high && !spectral_lines({fast}, {period}, above, high, certain).empty();
  };
  while (rows > 1 && swings()) rows -= 2;
  return rows;
}

}  // namespace

std::size_t rows_to_average(const Datasheet& sheet, const std::vector<const Recording*>& recordings,
                            const GapOptions& options) {
  std::size_t rows = std::numeric_limits<std::size_t>::max();
  for (const Recording* recording : recordings) {
    if (rows == 1) break;
    rows = std::min(rows, rows_of_one(sheet, *recording, options));
  }
  return recordings.empty() ? 1 : rows;
}

GapOptions for_averages(GapOptions options, std::size_t rows) {
  const auto n = static_cast<double>(rows);
  options.verdict.place_log_likelihood *= n;
  for_each_option(options, [n](const std::string& name, auto& value) {
    const bool of_gap = name.rfind("segments.", 0) != 0;
    if constexpr (std::is_same_v<decltype(value), double&>)
      if (of_gap && name.find("_variances") != std::string::npos) value *= n;
  });
  return options;
}

}  // namespace faultline
