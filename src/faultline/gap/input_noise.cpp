#include "faultline/gap/input_noise.h"

#include <algorithm>
#include <cmath>

#include "faultline/gap/linearisation.h"
#include "faultline/numerics/random.h"
#include "faultline/segments/smoothing.h"

namespace faultline {

bool has_noisy_inputs(const std::vector<SegmentedRun>& runs) {
  return std::any_of(runs.begin(), runs.end(), [](const SegmentedRun& run) {
    return std::any_of(run.input_noise.begin(), run.input_noise.end(), [](double noise) { return noise > 0; });
  });
}

ResidualModel with_input_noise(const ResidualModel& residuals, std::uint64_t seed) {
  std::vector<SegmentedRun> runs = residuals.runs();
  const SegmentOptions& options = residuals.options().segments;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    SegmentedRun& run = runs[r];
    Recording& recording = run.recording;
    Random random(seed + r);
    for (std::size_t k = 0; k < recording.rows(); ++k)
      for (std::size_t c = 0; c < run.input_noise.size(); ++c)
        if (run.input_noise[c] > 0)
          recording.values[k * recording.columns() + c] += run.input_noise[c] * random.normal();
    for (const Stretched& stretch : run.stretches)
      smooth_inputs(residuals.sheet(), recording, stretch.first, stretch.last, widest_window(run, options),
                    run.input_noise, options);
  }
  return residuals.over(std::move(runs));
}

std::vector<Eigen::MatrixXf> placebo_residuals(const ResidualModel& noisy, const ModelChange& model,
                                               const std::vector<std::size_t>& runs,
                                               const std::vector<Eigen::MatrixXf>& plain,
                                               const std::vector<Eigen::MatrixXf>& left, std::uint64_t seed, int jobs) {
  std::vector<Eigen::MatrixXf> result = residuals_of(noisy, model, runs, jobs);
  Random random(seed);
  for (std::size_t i = 0; i < result.size(); ++i) {
    result[i] -= plain[i];
    const SegmentedRun& run = noisy.runs()[runs[i]];
    const auto rows = static_cast<Eigen::Index>(run.segment);
    for (const std::size_t restart : run.restarts)
      for (Eigen::Index c = 0; c < result[i].cols(); ++c) {
        const auto first = static_cast<Eigen::Index>(restart);
        const float rms = left[i].col(c).segment(first, rows).norm() / std::sqrt(static_cast<float>(rows));
        for (float& value : result[i].col(c).segment(first, rows)) value += rms * static_cast<float>(random.normal());
      }
  }
  return result;
}

}  // namespace faultline
