#include "nodes/estimator_host.h"

#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "faultline/signal/error.h"
#include "nodes/node_main.h"

namespace faultline {
namespace {

constexpr double kSubscriberWait = 10;  // s

const StageSpec& find_stage(const Datasheet& sheet, const std::string& name) {
  if (sheet.estimators.empty())
    throw InputError(fmt::format("{}: the datasheet names no estimator; this rig cannot be diagnosed yet", sheet.file));
  std::vector<std::string> known;
  for (const StageSpec& spec : sheet.estimators) {
    if (name.empty() || spec.name == name) return spec;
    known.push_back(spec.name);
  }
  throw InputError(fmt::format("parameter ~stage: {} has no estimator '{}'; there are: {}", sheet.file, name,
                               fmt::join(known, ", ")));
}

}  // namespace

EstimatorHost::EstimatorHost(const Datasheet& sheet, const std::string& stage)
    : sheet_(sheet),
      stage_(sheet, find_stage(sheet, stage)),
      names_(names_of(sheet, stage_)),
      private_node_("~"),
      input_(sheet, [this](const Sample& sample) { take(sample); }),
      health_(sheet.rig, stage_.name(), [this](diagnostic_updater::DiagnosticStatusWrapper& status) { tell(status); }) {
  estimates_ = node_.advertise<faultline_msgs::Estimate>(topic(sheet.rig, "estimate"), kQueue);
  service_ = private_node_.advertiseService("reset", &EstimatorHost::reset, this);
}

void EstimatorHost::start(int wait_for) {
  if (wait_for > 0) wait_for_subscribers(estimates_, wait_for, kSubscriberWait);
  input_.start();
}

void EstimatorHost::take(const Sample& sample) {
  if (stage_.process(sample, estimate_)) estimates_.publish(to_message(estimate_, names_));
}

bool EstimatorHost::reset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  stage_.reset();
  response.success = true;
  response.message = fmt::format("{} begins anew with the next sample", stage_.name());
  return true;
}

void EstimatorHost::tell(diagnostic_updater::DiagnosticStatusWrapper& status) {
  input_.tell(status);
  const EstimatorCounts& counts = stage_.counts();
  status.add("estimates", counts.used);
  status.add("not newer than the last", counts.stale);
  status.add("restarts of the estimator", counts.restarts);
  status.add("values missing", counts.missing);
  status.add("values out of range", counts.out_of_range);
}

}  // namespace faultline
