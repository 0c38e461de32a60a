#include "faultline/gap/next_run.h"

#include <algorithm>
#include <numeric>

#include <fmt/format.h>

#include "faultline/rig/simulator.h"
#include "faultline/segments/segment_length.h"

namespace faultline {
namespace {

// Log-likelihood between the two in a run with this profile.
double separation(const Datasheet& sheet, const std::string& profile, double duration, const ModelChange& first,
                  const ModelChange& second, const GapOptions& options, int jobs) {
  SimulationSetup setup;
  setup.profile = profile;
  setup.parameters = first.parameters;
  setup.effects = first.effects;
  Recording recording = simulate(sheet, setup, duration);
  SegmentedRun run = cut_run(sheet, profile, std::move(recording), segment_length(sheet), options.segments);
  const ResidualModel model(sheet, {std::move(run)}, options);
  const Linearisation linear(model, second, {0}, jobs);
  const Eigen::VectorXd z = deviations(sheet, linear.free_parameters(), second.parameters);
  const double rival = adjusted(linear, linear.products(linear.at_model()), z).loss;
  const std::vector<double> losses = linear.segment_losses({model.residuals(first, 0)});
  double truth = 0.5 * deviations(sheet, linear.free_parameters(), first.parameters).squaredNorm();
  for (const double loss : losses) truth += linear.robust(loss);
  return rival - truth;
}

}  // namespace

std::vector<NextRun> separating_runs(const Datasheet& sheet, const ModelChange& first, const ModelChange& second,
                                     const std::string& between, const GapOptions& options, int jobs,
                                     std::vector<std::string>& remarks) {
  const double segment = segment_length(sheet);
  std::vector<NextRun> result;
  if (sheet.profiles.empty()) remarks.push_back("no run is proposed: the datasheet has no profile to simulate");
  for (const Profile& profile : sheet.profiles) {
    const double duration =
        std::clamp(profile.duration, options.next_runs.least_segments * segment, options.next_runs.segments * segment);
    try {
      const double gain = separation(sheet, profile.name, duration, first, second, options, jobs);
      if (gain > options.next_runs.separating_log_likelihood) result.push_back({profile.name, duration, gain, between});
    } catch (const std::exception& error) {
      remarks.push_back(fmt::format("{} was not tried as the next run: {}", profile.name, error.what()));
    }
  }
  std::stable_sort(result.begin(), result.end(), [](const NextRun& a, const NextRun& b) { return a.gain > b.gain; });
  if (result.size() > options.next_runs.most) result.resize(options.next_runs.most);
  return result;
}

}  // namespace faultline
