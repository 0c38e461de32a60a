#include "faultline/gap/measure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "faultline/gap/gap_series.h"
#include "faultline/numerics/in_parallel.h"

namespace faultline {
namespace {

constexpr const char* kLevels[] = {"nominal", "refit", "explained"};
constexpr double kSamePeriod = 0.01;
constexpr double kHeldByFew = 0.5;  // of a typical segment's shrink: less of the mean is held by a few segments
constexpr std::size_t kWhole = std::numeric_limits<std::size_t>::max() / 2;  // rows: no restart but at breaks

ChannelGap channel_gap(const ResidualModel& model, std::size_t output) {
  const Channel& channel = model.sheet().channels[static_cast<std::size_t>(model.outputs()[output])];
  ChannelGap gap;
  gap.channel = channel.name;
  gap.unit = channel.unit;
  gap.noise_std = model.noise()[output];
  return gap;
}

struct Moments {
  double readings = 0, deviation = 0;
};

Moments moments(const ResidualModel& model, std::size_t output) {
  double s = 0, s2 = 0, n = 0;
  for (const SegmentedRun& run : model.runs())
    for (std::size_t k = 0; k < run.recording.rows(); ++k) {
      const double v = run.recording.at(k, static_cast<std::size_t>(model.outputs()[output]));
      if (!std::isfinite(v)) continue;
      s += v;
      s2 += v * v;
      n += 1;
    }
  return {n, n > 0 ? std::sqrt(std::max(s2 / n - s / n * s / n, 0.0)) : 0};
}

Eigen::VectorXd column_squares(const Eigen::MatrixXf& residuals) {
  return residuals.colwise().squaredNorm().transpose().cast<double>();
}

std::string percent(double share) {
  if (share <= 0) return "nothing";
  return share < 0.005 ? "less than 1 %" : fmt::format("{:.0f} %", 100 * share);
}

// `settled`: of each run.
GapLevel level(const ResidualModel& model, const std::string& name, const ModelChange& at,
               const std::vector<Eigen::MatrixXf>& settled, int jobs) {
  GapLevel result;
  result.name = name;
  const std::size_t outputs = model.outputs().size();
  for (std::size_t o = 0; o < outputs; ++o) result.channels.push_back(channel_gap(model, o));
  const std::pair<const char*, std::size_t> horizons[] = {
      {"1", 1}, {"10", 10}, {"100", 100}, {"segment", 0}, {"free", kWhole}};
  const std::size_t runs = settled.size();
  std::vector<Eigen::VectorXd> squares(std::size(horizons) * runs);  // per output, horizon by horizon
  in_parallel(squares.size(), jobs, [&](std::size_t i) {
    const std::size_t horizon = horizons[i / runs].second, r = i % runs;
    squares[i] = column_squares(horizon == 0 ? settled[r] : model.residuals(at, r, horizon));
  });
  std::vector<Moments> measured;
  for (std::size_t o = 0; o < outputs; ++o) measured.push_back(moments(model, o));
  for (std::size_t h = 0; h < std::size(horizons); ++h) {
    const std::string key = horizons[h].first;
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(outputs));
    for (std::size_t r = 0; r < runs; ++r) sum += squares[h * runs + r];
    for (std::size_t o = 0; o < outputs; ++o) {
      ChannelGap& gap = result.channels[o];
      const double square = sum[static_cast<Eigen::Index>(o)] / std::max(measured[o].readings, 1.0);
      const double rms = gap.noise_std * std::sqrt(square);
      gap.rms[key] = rms;
      gap.nrmse[key] = rms / std::max(measured[o].deviation, 1e-300);
      gap.fit[key] = 100 * (1 - gap.nrmse[key]);
      if (key == "segment") gap.excess = std::max(0.0, square - 1);
    }
  }
  // Of what nobody measured there is no gap.
  for (std::size_t o = outputs; o-- > 0;)
    if (measured[o].readings == 0) result.channels.erase(result.channels.begin() + static_cast<std::ptrdiff_t>(o));
  for (const ChannelGap& gap : result.channels)
    result.excess += gap.excess / static_cast<double>(result.channels.size());
  const Datasheet& sheet = model.sheet();
  for (std::size_t i = 0; i < sheet.parameters.size(); ++i)
    if (at.parameters[i] != sheet.parameters[i].nominal)
      result.parameters[sheet.parameters[i].name] = at.parameters[i] / sheet.parameters[i].nominal;
  return result;
}

// Energy between means over b and over 4 b samples, b = `narrow`.
double band_energy(const std::vector<Eigen::MatrixXf>& residuals, Eigen::Index narrow) {
  const Eigen::Index wide = 4 * narrow;
  double energy = 0;
  for (const auto& matrix : residuals)
    for (Eigen::Index first = 0; first + wide <= matrix.rows(); first += wide) {
      const Eigen::RowVectorXf whole = matrix.middleRows(first, wide).colwise().mean();
      for (Eigen::Index i = 0; i < 4; ++i)
        energy += static_cast<double>(
                      (matrix.middleRows(first + i * narrow, narrow).colwise().mean() - whole).squaredNorm()) *
                  static_cast<double>(narrow);
    }
  return energy;
}

void find_regions(const ResidualModel& model, const std::vector<Eigen::MatrixXf>& residuals,
                  const std::vector<Eigen::MatrixXf>& explained, GapResult& result) {
  const Datasheet& sheet = model.sheet();
  const GapOptions::Regions& options = model.options().regions;
  double total = 0, rows = 0;
  std::vector<Eigen::VectorXf> squares, squares_explained;
  for (const auto& matrix : explained) squares_explained.push_back(matrix.rowwise().squaredNorm());
  for (const auto& matrix : residuals) {
    squares.push_back(matrix.rowwise().squaredNorm());
    total += static_cast<double>(squares.back().sum());
    rows += static_cast<double>(matrix.rows());
  }
  const double mean = total / rows;
  const double outputs = static_cast<double>(model.outputs().size());
  for (std::size_t c = 0; c < sheet.channels.size(); ++c) {
    const Channel& channel = sheet.channels[c];
    if (channel.ground_truth || channel.role == Role::setpoint || channel.role == Role::input) continue;
    std::vector<double> sorted;
    for (const SegmentedRun& run : model.runs())
      for (std::size_t k = 0; k < run.recording.rows(); k += options.quantile_stride)
        if (std::isfinite(run.recording.at(k, c))) sorted.push_back(run.recording.at(k, c));
    if (sorted.empty()) continue;
    std::sort(sorted.begin(), sorted.end());
    const double low = sorted[sorted.size() / 10], high = sorted[sorted.size() - 1 - sorted.size() / 10];
    const double span =
        std::max(std::abs(sorted[sorted.size() / 40]), std::abs(sorted[sorted.size() - 1 - sorted.size() / 40]));
    const bool both_signs = low < 0 && high > 0;
    struct Part {
      std::string name;
      double sum = 0, count = 0, explained = 0;
    };
    std::vector<Part> parts = {{channel.name + " positive"},
                               {channel.name + " negative"},
                               {channel.name + " near zero"},
                               {channel.name + " among its highest tenth"},
                               {channel.name + " among its lowest tenth"}};
    for (std::size_t r = 0; r < residuals.size(); ++r)
      for (Eigen::Index k = 0; k < squares[r].size(); ++k) {
        const double v = model.runs()[r].recording.at(static_cast<std::size_t>(k), c);
        const double s = static_cast<double>(squares[r][k]), after = static_cast<double>(squares_explained[r][k]);
        const auto add = [&](std::size_t i, bool inside) {
          if (!inside) return;
          parts[i].sum += s;
          parts[i].explained += after;
          parts[i].count += 1;
        };
        add(0, both_signs && v > options.standstill_fraction * span);
        add(1, both_signs && v < -options.standstill_fraction * span);
        add(2, both_signs && std::abs(v) <= options.standstill_fraction * span);
        add(3, v >= high);
        add(4, v <= low);
      }
    for (const Part& part : parts)
      if (part.count > options.least_fraction * rows && part.sum / part.count > options.notable_ratio * mean)
        result.regions.push_back({part.name, part.sum / part.count / mean, part.count / rows,
                                  part.sum / part.count / outputs, part.explained / part.count / outputs});
  }
  std::stable_sort(result.regions.begin(), result.regions.end(),
                   [](const Region& a, const Region& b) { return a.enrichment > b.enrichment; });
  if (result.regions.size() > options.most) result.regions.resize(options.most);

  // Bands by block means: their energy, against what white noise of the same power has there. In blocks of samples, so
  // of the runs that have the first one's period.
  std::vector<Eigen::MatrixXf> alike, alike_explained;
  double values = 0, power = 0;
  for (std::size_t r = 0; r < residuals.size(); ++r) {
    if (std::abs(model.runs()[r].period / model.runs().front().period - 1) > kSamePeriod) continue;
    alike.push_back(residuals[r]);
    alike_explained.push_back(explained[r]);
    values += static_cast<double>(residuals[r].size());
    power += static_cast<double>(residuals[r].squaredNorm());
  }
  for (Eigen::Index b = 1; b <= 64; b *= 4) {
    const double rate = 1 / model.runs().front().period, width = static_cast<double>(b);
    const double energy = band_energy(alike, b), fraction = energy / std::max(power, 1e-300);
    result.bands.push_back({fmt::format("{:.3g} to {:.3g} Hz", rate / (8 * width), rate / (2 * width)),
                            fraction / (0.75 / width), fraction, energy / values,
                            band_energy(alike_explained, b) / values});
  }
}

}  // namespace

void measure_levels(const ResidualModel& model, const ModelChange& nominal, const ModelChange& refitted,
                    const FitResult& explained, int jobs, GapResult& result) {
  ModelChange best = explained.model;
  best.effects.clear();
  for (const Candidate& candidate : explained.effects) best.effects.push_back(candidate.effect);
  const std::size_t runs = model.runs().size();
  const std::array<const ModelChange*, 3> levels = {&nominal, &refitted, &best};
  std::array<std::vector<Eigen::MatrixXf>, 3> settled;
  for (std::vector<Eigen::MatrixXf>& level : settled) level.resize(runs);
  in_parallel(3 * runs, jobs, [&](std::size_t i) {
    settled[i / runs][i % runs] = settled_residuals(model, *levels[i / runs], i % runs, jobs);
  });
  for (std::size_t i = 0; i < 3; ++i) result.gap.push_back(level(model, kLevels[i], *levels[i], settled[i], jobs));
  std::size_t deciding = 0;
  double most = 0;
  for (std::size_t r = 0; r < runs; ++r) {
    const double gain = static_cast<double>(settled[1][r].squaredNorm() - settled[2][r].squaredNorm()) /
                        static_cast<double>(settled[1][r].size());
    if (r == 0 || gain > most) {
      most = gain;
      deciding = r;
    }
  }
  result.deciding_run = model.runs()[deciding].name;
  result.series = gap_series(model, deciding, {&settled[0][deciding], &settled[1][deciding], &settled[2][deciding]},
                             result.runs.size() + result.holdout.size());
  find_regions(model, settled[1], settled[2], result);
}

namespace {

// Of what is left under a verdict that names no cause: too little of the motion to matter, or without a place.
std::string untold(const GapResult& result, const std::string& left) {
  if (result.evidence.size > result.matters) return "No place and no effect tells what is left: " + left + ".";
  return fmt::format("What is left, {}, is {:.2g} of what the channels move, too little to matter (--matters {:g}).",
                     left, result.evidence.size, result.matters);
}

// Effects in words: those that close something, and grids, which are in the noise.
struct Told {
  std::string closing, rounded;
  const char* close;  // the verb
};

Told told_of(const std::vector<NamedEffect>& effects) {
  Told told;
  std::size_t closing = 0;
  for (const NamedEffect& e : effects) {
    const bool grid = e.effect == "quantisation";
    closing += !grid;
    std::string& part = grid ? told.rounded : told.closing;
    part += fmt::format("{}{} at {}", part.empty() ? "" : " and ", e.effect, e.port);
  }
  if (!told.rounded.empty()) told.rounded += ": it is in the noise, which no model closes.";
  told.close = closing > 1 ? "close" : "closes";
  return told;
}

}  // namespace

void describe(const Datasheet& sheet, GapResult& result, const std::string& left) {
  const Told told = told_of(result.effects);
  if (result.verdict == "none") {
    result.sentence =
        left.empty() ? "No gap beyond the noise and the tolerances of the datasheet." : untold(result, left);
  } else if (result.verdict == "miscalibrated") {
    std::string moved;
    for (const auto& [name, factor] : result.gap[1].parameters) {
      const Parameter& p = sheet.parameters[static_cast<std::size_t>(sheet.parameter(name))];
      if (std::abs(factor - 1) > p.tolerance)
        moved += fmt::format("{}{} x {:.3f}", moved.empty() ? "" : ", ", name, factor);
    }
    if (moved.empty())
      result.sentence = left.empty() ? "The structure fits; the parameters are off within their tolerances."
                                     : "Parameters within their tolerances explain a part.";
    else
      result.sentence =
          (left.empty() ? "The structure fits; the parameters are off: " : "The parameters are off: ") + moved + ".";
    if (!left.empty()) result.sentence += " " + untold(result, left);
  } else if (result.verdict == "named") {
    result.sentence = told.closing;
    const double typical = result.evidence.typical_shrink;
    if (!result.sentence.empty() && typical > 0 && result.shrink_refit < kHeldByFew * typical)
      result.sentence += fmt::format(
          " {} {:.0f} % of what the refit leaves in a typical segment; most of the gap is in a few segments, in which "
          "something else is missing.",
          told.close, 100 * typical);
    else if (!result.sentence.empty())
      result.sentence += fmt::format(" {} {:.0f} % of what the refit leaves.", told.close, 100 * result.shrink_refit);
    result.sentence += (result.sentence.empty() || told.rounded.empty() ? "" : " ") + told.rounded;
    if (!result.equivalent.empty())
      result.sentence += result.equivalent.size() == 1
                             ? " One other effect explains these runs as well."
                             : fmt::format(" {} other effects explain these runs as well.", result.equivalent.size());
    if (!left.empty()) result.sentence += fmt::format(" Beside that something is missing that matters: {}.", left);
  } else {
    result.sentence = "Something the library does not know";
    if (!result.places.empty()) result.sentence += " at or near " + result.places.front().port;
    if (!left.empty()) result.sentence += ", and no single place explains much of it (" + left + ")";
    result.sentence += "; ";
    if (!told.closing.empty())
      result.sentence += fmt::format("the nearest, {}, {} {} of what the refit leaves.", told.closing, told.close,
                                     percent(result.shrink_refit));
    else if (result.ranked.empty())
      result.sentence += "no effect of the library could be tried.";
    else
      result.sentence += fmt::format("no effect of the library explains it, {} at {} the nearest.",
                                     result.ranked.front().effect.effect, result.ranked.front().effect.port);
    if (!told.rounded.empty()) result.sentence += " " + told.rounded;
  }
}

}  // namespace faultline
