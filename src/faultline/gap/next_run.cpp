#include "faultline/gap/next_run.h"

#include <algorithm>
#include <numeric>

#include "faultline/segments/time_scales.h"

namespace faultline {

std::vector<NextRun> separating_runs(const Datasheet& sheet, const GapModel& first, const GapModel& second,
                                     const std::string& between, const GapOptions& options, int jobs) {
  const double segment = segment_length(sheet);
  const double duration = options.next_runs.duration_segments * segment;
  std::vector<NextRun> result;
  for (const Profile& profile : sheet.profiles) {
    SimulationSetup setup;
    setup.profile = profile.name;
    setup.parameters = first.parameters;
    setup.effects = first.effects;
    Recording recording = simulate(sheet, setup, duration);
    GapRun run = cut_run(sheet, profile.name, std::move(recording), segment, options.segments);
    const ResidualModel model(sheet, {std::move(run)}, options);
    const Linearisation linear(model, second, {0}, jobs);
    const Eigen::VectorXd z = deviations(sheet, linear.free_parameters(), second.parameters);
    const double rival = projected_loss(linear, linear.products(linear.at_model()), z);
    const std::vector<double> losses = linear.segment_losses({model.residuals(first, 0)});
    double truth = 0.5 * deviations(sheet, linear.free_parameters(), first.parameters).squaredNorm();
    for (const double loss : losses) truth += linear.robust(loss);
    if (rival - truth > options.next_runs.separating_log_likelihood)
      result.push_back({profile.name, duration, rival - truth, between});
  }
  std::stable_sort(result.begin(), result.end(), [](const NextRun& a, const NextRun& b) { return a.gain > b.gain; });
  if (result.size() > options.next_runs.most) result.resize(options.next_runs.most);
  return result;
}

}  // namespace faultline
