#include "faultline/tuning/threshold_tuning.h"

#include <algorithm>
#include <cmath>
#include <deque>

#include <fmt/format.h>

#include "faultline/detectors/detector.h"
#include "faultline/estimators/estimator_stage.h"
#include "faultline/numerics/random.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kEuler = 0.57721566490153286;
constexpr double kSecondsPerHour = 3600;
constexpr std::size_t kFewestBlocks = 8;
constexpr int kBootstraps = 400;

// The least criterion over the last `minimum_time` s: what an alarm needs to be above the threshold.
class Sustained {
 public:
  explicit Sustained(double duration) : duration_(duration) {}
  double add(double time, double value) {
    if (std::isnan(value)) {
      window_.clear();
      began_ = std::nan("");
      return value;
    }
    if (std::isnan(began_)) began_ = time;
    while (!window_.empty() && window_.back().second >= value) window_.pop_back();
    window_.emplace_back(time, value);
    while (window_.front().first < time - duration_) window_.pop_front();
    return time - began_ >= duration_ ? window_.front().second : std::nan("");
  }

 private:
  double duration_;
  double began_ = std::nan("");
  std::deque<std::pair<double, double>> window_;
};

struct Watched {
  std::string name;
  std::unique_ptr<Detector> detector;
  Criterion criterion;
  double minimum_time;
};

std::vector<Watched> detectors_of(const Datasheet& sheet, const StageSpec& stage) {
  std::vector<Watched> result;
  for (const StageSpec& spec : sheet.detectors) {
    if (spec.settings.word_or("stage", sheet.estimators.front().name) != stage.name) continue;
    Watched w{spec.name, make_detector(sheet, spec), {}, spec.settings.number_or("minimum_time", 0, 0, 1e6)};
    w.criterion = w.detector->criterion();
    if (w.criterion.setting) result.push_back(std::move(w));
  }
  return result;
}

// Runs the stage and its detectors: sustained(detector, time, value) for every sample.
template <class Take>
void watch(const Datasheet& sheet, const StageSpec& stage, const Recording& recording, std::vector<Watched>& watched,
           Take&& take) {
  EstimatorStage filter(sheet, stage);
  std::vector<Sustained> sustained;
  for (Watched& w : watched) {
    w.detector->reset();
    sustained.emplace_back(w.minimum_time);
  }
  Estimate estimate;
  Detection detection;
  Sample sample;
  sample.values.resize(recording.columns());
  for (std::size_t k = 0; k < recording.rows(); ++k) {
    sample.time = recording.time[k];
    std::copy_n(recording.row(k), recording.columns(), sample.values.begin());
    if (!filter.process(sample, estimate)) continue;
    for (std::size_t d = 0; d < watched.size(); ++d) {
      watched[d].detector->process(estimate, detection);
      take(d, sample.time - recording.time.front(),
           sustained[d].add(sample.time, watched[d].detector->criterion().value));
    }
  }
}

// Largest sustained criterion per block and detector.
std::vector<std::vector<double>> block_maxima(const Datasheet& sheet, const StageSpec& stage,
                                              std::vector<Watched>& watched, const std::vector<Recording>& healthy,
                                              double block) {
  std::vector<std::vector<double>> maxima(watched.size());
  for (const Recording& recording : healthy) {
    const double duration = recording.time.back() - recording.time.front();
    const auto blocks = static_cast<std::size_t>(duration / block);
    std::vector<std::vector<double>> here(watched.size(), std::vector<double>(blocks, std::nan("")));
    watch(sheet, stage, recording, watched, [&](std::size_t d, double time, double value) {
      const auto b = static_cast<std::size_t>(time / block);
      if (b < blocks && !std::isnan(value)) here[d][b] = std::isnan(here[d][b]) ? value : std::max(here[d][b], value);
    });
    for (std::size_t d = 0; d < watched.size(); ++d)
      for (const double value : here[d])
        if (!std::isnan(value)) maxima[d].push_back(value);
  }
  return maxima;
}

void check_blocks(const std::vector<double>& maxima, const std::string& detector, double block) {
  if (maxima.size() < kFewestBlocks)
    throw InputError(
        fmt::format("tune: {} blocks of {:g} s are too few to choose a threshold for '{}'; record at least {} of them",
                    maxima.size(), block, detector, kFewestBlocks));
}

}  // namespace

double Gumbel::level(double rate, double block) const { return location - scale * std::log(rate * block); }

Gumbel fit_gumbel(std::vector<double> maxima) {
  std::sort(maxima.begin(), maxima.end());
  const double n = static_cast<double>(maxima.size());
  double b0 = 0, b1 = 0;
  for (std::size_t i = 0; i < maxima.size(); ++i) {
    b0 += maxima[i] / n;
    b1 += static_cast<double>(i) / (n - 1) * maxima[i] / n;
  }
  Gumbel g;
  g.scale = std::max((2 * b1 - b0) / std::log(2.0), 1e-300);
  g.location = b0 - kEuler * g.scale;
  return g;
}

std::vector<Threshold> tune_thresholds(const Datasheet& sheet, const StageSpec& stage,
                                       const std::vector<Recording>& healthy, double rate, double block) {
  std::vector<Watched> watched = detectors_of(sheet, stage);
  const std::vector<std::vector<double>> maxima = block_maxima(sheet, stage, watched, healthy, block);
  std::vector<Threshold> result;
  for (std::size_t d = 0; d < watched.size(); ++d) {
    check_blocks(maxima[d], watched[d].name, block);
    const Gumbel gumbel = fit_gumbel(maxima[d]);
    Threshold t;
    t.detector = watched[d].name;
    t.setting = watched[d].criterion.setting;
    t.set = watched[d].criterion.threshold;
    t.offset = watched[d].criterion.offset;
    t.chosen = gumbel.level(rate / kSecondsPerHour, block);
    t.blocks = maxima[d].size();
    t.rate_as_set = kSecondsPerHour / block * -std::expm1(-std::exp(-(t.set - gumbel.location) / gumbel.scale));
    Random random(d + 1);
    std::vector<double> levels;
    for (int i = 0; i < kBootstraps; ++i) {
      std::vector<double> drawn;
      for (std::size_t k = 0; k < maxima[d].size(); ++k)
        drawn.push_back(maxima[d][std::min(
            maxima[d].size() - 1, static_cast<std::size_t>(random.uniform() * static_cast<double>(maxima[d].size())))]);
      levels.push_back(fit_gumbel(std::move(drawn)).level(rate / kSecondsPerHour, block));
    }
    std::sort(levels.begin(), levels.end());
    t.upper = levels[static_cast<std::size_t>(0.95 * kBootstraps)];
    const auto [least, most] = std::minmax_element(maxima[d].begin(), maxima[d].end());
    if (*least == *most) t.chosen = t.upper = t.set;
    result.push_back(t);
  }
  return result;
}

std::vector<TradeOff> trade_off(const Datasheet& sheet, const StageSpec& stage, const std::string& detector,
                                std::size_t state, const std::vector<double>& factors, const std::vector<double>& rates,
                                const std::vector<Recording>& healthy, const std::vector<FaultyRun>& faulty,
                                double block) {
  std::vector<TradeOff> result;
  for (const double factor : factors) {
    StageSpec changed = stage;
    std::vector<double> noise = stage.settings.list("process_noise", 0, 0, 1e12);
    noise.at(state) *= factor;
    changed.settings.set("process_noise", noise);
    std::vector<Watched> watched = detectors_of(sheet, stage);
    watched.erase(std::remove_if(watched.begin(), watched.end(), [&](const Watched& w) { return w.name != detector; }),
                  watched.end());
    if (watched.empty())
      throw InputError(fmt::format("tune: stage '{}' has no detector '{}' with a threshold", stage.name, detector));
    const std::vector<double> maxima = block_maxima(sheet, changed, watched, healthy, block).front();
    check_blocks(maxima, detector, block);
    const Gumbel gumbel = fit_gumbel(maxima);
    std::vector<TradeOff> row;
    for (const double rate : rates)
      row.push_back({factor, noise[state], rate, gumbel.level(rate / kSecondsPerHour, block),
                     std::vector<double>(faulty.size(), std::nan(""))});
    for (std::size_t f = 0; f < faulty.size(); ++f) {
      std::vector<bool> early(rates.size(), false);
      watch(sheet, changed, faulty[f].recording, watched, [&](std::size_t, double time, double value) {
        for (std::size_t r = 0; r < rates.size(); ++r) {
          if (!(value > row[r].threshold) || early[r] || !std::isnan(row[r].delays[f])) continue;
          if (time < faulty[f].onset)
            early[r] = true;
          else
            row[r].delays[f] = time - faulty[f].onset;
        }
      });
    }
    result.insert(result.end(), row.begin(), row.end());
  }
  return result;
}

}  // namespace faultline
