#include "nodes/estimator_host.h"

#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "faultline/signal/error.h"
#include "nodes/node_main.h"

namespace faultline {
namespace {

constexpr double kSubscriberWait = 10;  // s

std::vector<StageSpec> find_stages(const Datasheet& sheet, EstimatorFamily family, const std::string& name) {
  if (sheet.estimators.empty())
    throw InputError(fmt::format("{}: the datasheet names no estimator; this rig cannot be diagnosed yet", sheet.file));
  std::vector<StageSpec> found;
  std::vector<std::string> known;
  for (const StageSpec& spec : sheet.estimators) {
    if (is_least_squares(spec.type) != (family == EstimatorFamily::least_squares)) continue;
    if (name.empty() || spec.name == name) found.push_back(spec);
    known.push_back(spec.name);
  }
  if (known.empty())
    throw InputError(
        fmt::format("{}: the datasheet names no estimator of this family; leave this node out", sheet.file));
  if (found.empty())
    throw InputError(fmt::format("parameter ~stage: {} has no estimator '{}' of this family; there are: {}", sheet.file,
                                 name, fmt::join(known, ", ")));
  return found;
}

std::string title(const std::vector<StageSpec>& stages) {
  std::vector<std::string> names;
  for (const StageSpec& spec : stages) names.push_back(spec.name);
  return fmt::format("{}", fmt::join(names, ", "));
}

}  // namespace

EstimatorHost::EstimatorHost(const Datasheet& sheet, EstimatorFamily family, const std::string& stage)
    : sheet_(sheet),
      private_node_("~"),
      input_(sheet, [this](const Sample& sample) { take(sample); }),
      health_(sheet.rig, title(find_stages(sheet, family, stage)),
              [this](diagnostic_updater::DiagnosticStatusWrapper& status) { tell(status); }) {
  for (const StageSpec& spec : find_stages(sheet, family, stage)) {
    EstimatorStage made(sheet, spec);
    EstimateNames names = names_of(sheet, made);
    hosted_.push_back({std::move(made), std::move(names), Estimate(), is_fault_response(spec.type), false});
  }
  estimates_ = node_.advertise<faultline_msgs::Estimate>(topic(sheet.rig, "estimate"), kQueue);
  service_ = private_node_.advertiseService("reset", &EstimatorHost::reset, this);
}

void EstimatorHost::start(int wait_for) {
  if (wait_for > 0) wait_for_subscribers(estimates_, wait_for, kSubscriberWait);
  input_.start();
}

void EstimatorHost::take(const Sample& sample) {
  for (Hosted& h : hosted_) h.taken = h.stage.process(sample, h.estimate) && h.stage.news();
  // Those that speak now and then come first: who joins the estimates of a sample (estimate_join.h) has then heard them.
  for (const bool occasional : {true, false})
    for (const Hosted& h : hosted_)
      if (h.taken && h.occasional == occasional) estimates_.publish(to_message(h.estimate, h.names));
}

bool EstimatorHost::reset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  std::vector<std::string> names;
  for (Hosted& h : hosted_) {
    h.stage.reset();
    names.push_back(h.stage.name());
  }
  response.success = true;
  response.message =
      fmt::format("{} begin{} anew with the next sample", fmt::join(names, ", "), names.size() > 1 ? "" : "s");
  return true;
}

void EstimatorHost::tell(diagnostic_updater::DiagnosticStatusWrapper& status) {
  input_.tell(status);
  const EstimatorCounts& counts = hosted_.front().stage.counts();  // alike for all: they see the same samples
  status.add("estimates", counts.used);
  status.add("not newer than the last", counts.stale);
  status.add("restarts of the estimator", counts.restarts);
  status.add("values missing", counts.missing);
  status.add("values out of range", counts.out_of_range);
}

}  // namespace faultline
