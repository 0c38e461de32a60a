#include "faultline/gap/next_run.h"

#include <algorithm>
#include <numeric>

namespace faultline {
namespace {

constexpr double kWorthwhile = 20;  // log likelihood: odds that leave no doubt
constexpr std::size_t kMost = 3;

}  // namespace

std::vector<NextRun> separating_runs(const Datasheet& sheet, const GapModel& first, const GapModel& second,
                                     const std::string& between, std::size_t segment, double duration, int jobs) {
  std::vector<NextRun> result;
  for (const Profile& profile : sheet.profiles) {
    SimulationSetup setup;
    setup.profile = profile.name;
    setup.parameters = first.parameters;
    setup.effects = first.effects;
    Recording recording = simulate(sheet, setup, duration);
    const ResidualModel model(sheet, {prepare_run(sheet, profile.name, std::move(recording), segment)}, segment);
    const Linearisation linear(model, second, {0}, jobs);
    const Eigen::VectorXd z = deviations(sheet, linear.free_parameters(), second.parameters);
    const double rival = projected_loss(linear, linear.products(linear.at_model()), z);
    const std::vector<double> losses = linear.segment_losses({model.residuals(first, 0)});
    double truth = 0.5 * deviations(sheet, linear.free_parameters(), first.parameters).squaredNorm();
    for (const double loss : losses) truth += robust(loss, linear.segment_values());
    if (rival - truth > kWorthwhile) result.push_back({profile.name, duration, rival - truth, between});
  }
  std::stable_sort(result.begin(), result.end(), [](const NextRun& a, const NextRun& b) { return a.gain > b.gain; });
  if (result.size() > kMost) result.resize(kMost);
  return result;
}

}  // namespace faultline
