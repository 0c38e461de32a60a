#include "nodes/estimator_host.h"

#include <algorithm>
#include <filesystem>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <ros/ros.h>

#include "faultline/alarms/estimate_join.h"
#include "faultline/signal/error.h"
#include "nodes/node_main.h"

namespace faultline {
namespace {

constexpr double kHistogramPeriod = 1;   // s
constexpr double kReferencePeriod = 60;  // s; what a crash may lose

// Places among the datasheet's estimators.
std::vector<std::size_t> find_stages(const Datasheet& sheet, const std::vector<std::string>& families,
                                     const std::string& name) {
  if (sheet.estimators.empty())
    throw InputError(fmt::format("{}: the datasheet names no estimator; this rig cannot be diagnosed yet", sheet.file));
  std::vector<std::size_t> found;
  std::vector<std::string> known;
  for (std::size_t i = 0; i < sheet.estimators.size(); ++i) {
    const StageSpec& spec = sheet.estimators[i];
    if (std::find(families.begin(), families.end(), estimator_type(spec).family) == families.end()) continue;
    if (name.empty() || spec.name == name) found.push_back(i);
    known.push_back(spec.name);
  }
  if (known.empty())
    throw InputError(fmt::format("{}: the datasheet names no estimator of the family {}; leave this node out",
                                 sheet.file, fmt::join(families, " or ")));
  if (found.empty())
    throw InputError(fmt::format("parameter ~stage: {} has no estimator '{}' of the family {}; there are: {}",
                                 sheet.file, name, fmt::join(families, " or "), fmt::join(known, ", ")));
  return found;
}

std::string title(const Datasheet& sheet, const std::vector<std::size_t>& stages) {
  std::vector<std::string> names;
  for (const std::size_t i : stages) names.push_back(sheet.estimators[i].name);
  return fmt::format("{}", fmt::join(names, ", "));
}

}  // namespace

EstimatorHost::EstimatorHost(const Datasheet& sheet, const std::vector<std::string>& families, const std::string& stage,
                             const std::string& reference, Listeners listeners)
    : sheet_(sheet),
      private_node_("~"),
      reference_(reference),
      input_(sheet, [this](const Sample& sample) { take(sample); }),
      health_(sheet.rig, title(sheet, find_stages(sheet, families, stage)),
              [this](diagnostic_updater::DiagnosticStatusWrapper& status) { tell(status); }) {
  const std::vector<bool> occasional = occasional_stages(sheet);
  for (const std::size_t i : find_stages(sheet, families, stage)) {
    EstimatorStage made(sheet, sheet.estimators[i]);
    EstimateNames names = names_of(sheet, made);
    hosted_.push_back({std::move(made), std::move(names), Estimate(), occasional[i], false});
  }
  estimates_ = listeners.advertise<faultline_msgs::Estimate>(node_, "estimate");
  service_ = private_node_.advertiseService("reset", &EstimatorHost::reset, this);
  if (!reference_.empty()) {
    if (std::filesystem::exists(reference_)) {
      const References references = read_references(reference_, sheet.rig);
      for (Hosted& h : hosted_) restore_stage(references, h.stage);
    }
    reference_timer_ = node_.createWallTimer(ros::WallDuration(kReferencePeriod),
                                             [this](const ros::WallTimerEvent&) { keep_reference(); });
  }
  if (std::any_of(hosted_.begin(), hosted_.end(), [](const Hosted& h) { return !h.stage.histograms().empty(); })) {
    histograms_ = node_.advertise<faultline_msgs::Histogram>("histogram", 100);
    histogram_timer_ = node_.createWallTimer(ros::WallDuration(kHistogramPeriod),
                                             [this](const ros::WallTimerEvent&) { publish_histograms(); });
  }
  listeners.wait();
  input_.start();
}

EstimatorHost::~EstimatorHost() {
  keep_reference();
  if (!reference_trouble_.empty()) ROS_ERROR("%s", reference_trouble_.c_str());
}

void EstimatorHost::publish_histograms() {
  if (histograms_.getNumSubscribers() == 0) return;
  for (const Hosted& h : hosted_) {
    if (h.estimate.channel_status.empty()) continue;  // no sample yet
    for (const HistogramView& view : h.stage.histograms()) histograms_.publish(to_message(view, h.names, h.estimate));
  }
}

void EstimatorHost::keep_reference() {
  if (reference_.empty()) return;
  References learnt;
  learnt.rig = sheet_.rig;
  for (const Hosted& h : hosted_)
    if (std::optional<Reference> reference = h.stage.reference())
      learnt.stages.push_back({h.stage.name(), std::move(*reference)});
  if (learnt.stages.empty()) return;
  try {
    update_references(learnt, reference_);
    reference_trouble_.clear();
  } catch (const InputError& error) {
    reference_trouble_ = error.what();
  }
}

void EstimatorHost::take(const Sample& sample) {
  for (Hosted& h : hosted_) h.due = h.stage.process(sample, h.estimate) && (!h.occasional || h.stage.news());
  // Those that speak now and then come first: who joins the estimates of a sample (estimate_join.h) has then heard
  // them.
  for (const bool occasional : {true, false})
    for (const Hosted& h : hosted_)
      if (h.due && h.occasional == occasional) estimates_.publish(to_message(h.estimate, h.names));
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
  if (!reference_trouble_.empty()) status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN, reference_trouble_);
}

int run_estimator_node(int argc, char** argv, const std::string& name, const std::vector<std::string>& families) {
  return run_node(argc, argv, name, [&](Parameters& parameters) {
    const Datasheet sheet = read_rig(parameters);
    const std::string stage = parameters.word("stage", "");
    const std::string reference = parameters.word("reference", "");
    Listeners listeners(parameters);
    parameters.check_used();
    const EstimatorHost node(sheet, families, stage, reference, std::move(listeners));
    ros::spin();
    return 0;
  });
}

}  // namespace faultline
