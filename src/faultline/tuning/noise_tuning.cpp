#include "faultline/tuning/noise_tuning.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "faultline/estimators/process_model.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

constexpr double kSettleFraction = 0.05;  // of each recording, in which the first estimates are still wrong
constexpr double kFirstLogStep = 2.3;     // of the logarithm: a factor of ten
constexpr double kLastLogStep = 0.2;
constexpr double kWorthwhileLogLikelihood = 1e-4;  // gain in mean log-likelihood
constexpr const char* kOwnNoise = "rig_model";     // it works them out where they are not given
constexpr double kLargestVariance = 1e12, kSmallestVariance = 1e-30;

struct Innovations {
  double likelihood = 0, readings = 0;  // readings: in all rows, that it rests on
  std::vector<InnovationQuality> rows;
};

Innovations run_filter(const Datasheet& sheet, const StageSpec& stage, const std::vector<Recording>& healthy) {
  Innovations result;
  std::vector<double> sum, square, lagged, last;
  double count = 0, samples = 0;
  for (const Recording& recording : healthy) {
    EstimatorStage filter(sheet, stage);
    Estimate estimate;
    Sample sample;
    sample.values.resize(recording.columns());
    const auto settle = static_cast<std::size_t>(kSettleFraction * static_cast<double>(recording.rows()));
    std::fill(last.begin(), last.end(), 0);
    for (std::size_t k = 0; k < recording.rows(); ++k) {
      sample.time = recording.time[k];
      std::copy_n(recording.row(k), recording.columns(), sample.values.begin());
      if (!filter.process(sample, estimate) || k < settle || estimate.observed == 0) continue;
      const std::size_t rows = estimate.innovation.size();
      if (sum.empty()) {
        sum.assign(rows, 0);
        square = lagged = last = sum;
        for (const int channel :
             make_process_model(stage.settings.word("model"), sheet, stage.settings)->measured_channels())
          result.rows.push_back({sheet.channels[static_cast<std::size_t>(channel)].name, 0, 0});
      }
      for (std::size_t i = 0; i < rows; ++i) {
        const double s = estimate.innovation_std[i];
        if (!(s > 0)) continue;
        const double e = estimate.innovation[i] / s;
        ++result.readings;
        result.likelihood -= 0.5 * (2 * std::log(s) + e * e);
        sum[i] += e;
        square[i] += e * e;
        lagged[i] += e * last[i];
        last[i] = e;
      }
      ++count;
    }
    samples += static_cast<double>(recording.rows());
  }
  if (count < 100)
    throw InputError(
        fmt::format("tune: {} samples are too few to judge innovations by; give longer recordings", samples));
  result.likelihood /= count;
  for (std::size_t i = 0; i < result.rows.size(); ++i) {
    result.rows[i].consistency = square[i] / count;
    result.rows[i].whiteness = square[i] > 0 ? lagged[i] / square[i] : 0;
  }
  return result;
}

}  // namespace

std::vector<bool> random_walks(const Datasheet& sheet, const StageSpec& stage) {
  const auto model = make_process_model(stage.settings.word("model"), sheet, stage.settings);
  const std::size_t n = model->states().size();
  std::vector<double> channels(sheet.channels.size()), state(n), variance(n), next(n);
  for (std::size_t c = 0; c < channels.size();
       ++c)  // somewhere inside every range, so that nothing is at rest by accident
    channels[c] = sheet.channels[c].minimum + 0.61 * (sheet.channels[c].maximum - sheet.channels[c].minimum);
  model->initial(channels.data(), state.data(), variance.data());
  model->take_inputs(channels.data());
  for (std::size_t i = 0; i < n; ++i)
    state[i] += 1e-3 * std::sqrt(std::max(variance[i], 1e-12)) * (1 + 0.1 * static_cast<double>(i));
  model->predict(state.data(), sheet.sample_period, next.data());
  std::vector<bool> walks(n);
  for (std::size_t i = 0; i < n; ++i) walks[i] = next[i] == state[i];
  return walks;
}

NoiseTuning tune_noise(const Datasheet& sheet, const StageSpec& stage, const std::vector<Recording>& healthy,
                       const std::function<void(int)>& progress, const std::function<bool()>& enough) {
  const bool given = stage.settings.has("process_noise") && stage.settings.has("measurement_noise");
  if (!given && stage.settings.word_or("model", "") != kOwnNoise)
    throw InputError(fmt::format("{}: stage '{}' has no process_noise and measurement_noise to choose",
                                 stage.settings.where(), stage.name));
  NoiseTuning result;
  if (given) {
    result.process_noise = stage.settings.list("process_noise", 0, 0, kLargestVariance);
    result.measurement_noise = stage.settings.list("measurement_noise", 0, 0, kLargestVariance);
  } else {
    const auto model = make_process_model(kOwnNoise, sheet, stage.settings);
    result.process_noise = model->process_noise();
    result.measurement_noise = model->measurement_noise();
  }
  result.walks = random_walks(sheet, stage);

  std::vector<double*> entries;
  for (double& r : result.measurement_noise) entries.push_back(&r);
  for (std::size_t i = 0; i < result.process_noise.size(); ++i)
    if (!result.walks[i] && result.process_noise[i] > 0) entries.push_back(&result.process_noise[i]);

  StageSpec trial = stage;
  const auto evaluate = [&] {
    trial.settings.set("process_noise", result.process_noise);
    trial.settings.set("measurement_noise", result.measurement_noise);
    return run_filter(sheet, trial, healthy);
  };
  Innovations best = evaluate();
  result.before = best.rows;
  result.likelihood_before = best.likelihood;
  const double rounds = std::ceil(std::log2(kFirstLogStep / kLastLogStep)) * static_cast<double>(entries.size());
  double done = 0;
  const auto stop = [&] {
    if (result.finished && enough && enough()) result.finished = false;
    return !result.finished;
  };
  for (double step = kFirstLogStep; step > kLastLogStep && !stop(); step *= 0.5) {
    for (double* entry : entries) {
      if (stop()) break;
      if (progress) progress(static_cast<int>(100 * done++ / rounds));
      for (const double factor : {std::exp(step), std::exp(-step)}) {
        bool moved = false;
        while (*entry * factor<kLargestVariance&& * entry * factor> kSmallestVariance && !stop()) {
          const double kept = *entry;
          *entry *= factor;
          Innovations tried = evaluate();
          // A filter that doubts its transducers would seem the better for leaving out what it explains badly.
          if (tried.readings < best.readings || !(tried.likelihood > best.likelihood + kWorthwhileLogLikelihood)) {
            *entry = kept;
            break;
          }
          best = std::move(tried);
          moved = true;
        }
        if (moved) break;
      }
    }
  }
  result.after = best.rows;
  result.likelihood_after = best.likelihood;
  return result;
}

}  // namespace faultline
