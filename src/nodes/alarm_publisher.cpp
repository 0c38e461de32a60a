#include "nodes/alarm_publisher.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include <fmt/format.h>
#include <ros/ros.h>

#include "faultline/signal/error.h"
#include "nodes/conversion.h"
#include "nodes/node_main.h"
#include "nodes/rig_input.h"

namespace faultline {
namespace {

using diagnostic_msgs::DiagnosticStatus;

constexpr double kBehind = 1;  // s of estimates behind samples: what a person at the stand should know

}  // namespace

AlarmPublisher::AlarmPublisher(const Datasheet& sheet, double patience, const std::string& reference,
                               const std::string& history)
    : sheet_(sheet),
      name_(ros::this_node::getNamespace().size() > 1 ? ros::this_node::getNamespace().substr(1) : sheet.rig),
      stage_(sheet),
      join_(occasional_stages(sheet)),
      monitor_(sequence_settings(sheet)),
      silence_(patience),
      before_(sheet.rig, history),
      reference_(reference),
      health_(sheet.rig, "alarms", [this](diagnostic_updater::DiagnosticStatusWrapper& status) { tell(status); }) {
  if (!reference_.empty() && std::filesystem::exists(reference_)) {
    const References references = read_references(reference_, sheet.rig);
    stage_.restore(references);
    kept_ = static_cast<std::size_t>(
        std::count_if(references.stages.begin(), references.stages.end(), [&](const StageReference& kept) {
          return std::none_of(sheet.estimators.begin(), sheet.estimators.end(),
                              [&](const StageSpec& spec) { return spec.name == kept.stage; });
        }));
  }
  alarms_ = node_.advertise<faultline_msgs::AlarmArray>("alarms", 100, true);
  diagnostics_ = node_.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 100);
  estimates_ = node_.subscribe<faultline_msgs::Estimate>(
      "estimate", kQueue, [this](const boost::shared_ptr<const faultline_msgs::Estimate>& message) { take(*message); },
      ros::VoidConstPtr(), ros::TransportHints().tcpNoDelay());
  end_ = node_.subscribe<std_msgs::Time>("end", 10, [this](const boost::shared_ptr<const std_msgs::Time>& message) {
    run_end_ = to_seconds(message->data);
  });
  watch_timer_ = node_.createWallTimer(ros::WallDuration(0.1), [this](const ros::WallTimerEvent&) { watch(); });
  second_timer_ = node_.createWallTimer(ros::WallDuration(1), [this](const ros::WallTimerEvent&) { each_second(); });
  published_changes_ = stage_.changes();
  publish();
}

double AlarmPublisher::simulated_seconds() const {
  return ros::Time::isSimTime() ? ros::Time::now().toSec() : std::numeric_limits<double>::quiet_NaN();
}

void AlarmPublisher::take(const faultline_msgs::Estimate& message) {
  const auto from = std::find_if(sheet_.estimators.begin(), sheet_.estimators.end(),
                                 [&](const StageSpec& spec) { return spec.name == message.stage; });
  if (from == sheet_.estimators.end()) {
    ++other_stage_;
    return;
  }
  Estimate estimate;
  try {
    estimate = from_message(message);
    if (estimate.channel_status.size() != sheet_.channels.size()) throw InputError("");
  } catch (const InputError&) {
    ++bad_;
    return;
  }
  if (!samples_) hear_samples();
  const double time = estimate.time;
  const std::uint64_t sequence = estimate.sequence;
  const auto stage = static_cast<std::size_t>(from - sheet_.estimators.begin());
  if (!join_.add(stage, std::move(estimate), estimates_of_sample_)) return;
  monitor_.observe(sequence, time);
  stage_.process(estimates_of_sample_);
  judged_ = time;
  judged_at_ = steady_seconds();
  if (heard_ == 0) silence_.arrived(time, steady_seconds(), simulated_seconds());
  if (stage_.changes() != published_changes_) publish();
}

// From the first estimate on: a player that waits for subscribers of the samples is to wait for the estimators.
void AlarmPublisher::hear_samples() {
  samples_ = node_.subscribe<faultline_msgs::Sample>(
      "sample", kQueue,
      [this](const boost::shared_ptr<const faultline_msgs::Sample>& message) {
        heard_ = to_seconds(message->header.stamp);
        silence_.arrived(heard_, steady_seconds(), simulated_seconds());
      },
      ros::VoidConstPtr(), ros::TransportHints().tcpNoDelay());
}

double AlarmPublisher::behind() const { return heard_ > 0 ? std::max(0.0, heard_ - judged_) : 0; }

void AlarmPublisher::watch() {
  const double now = silence_.now(steady_seconds(), simulated_seconds());
  if (std::isnan(now) || behind() > 0 || (heard_ > 0 && heard_ == run_end_)) return;
  stage_.advance(now);
  if (stage_.changes() != published_changes_) publish();
}

void AlarmPublisher::publish() {
  published_changes_ = stage_.changes();
  const AlarmReport report = before_.with(stage_.report());
  alarms_.publish(to_message(report));
  diagnostic_msgs::DiagnosticArray array = to_diagnostics(report, name_);
  closed_.close(array);
  array.header.stamp = ros::Time::now();
  if (monitor_.counts().received == 0) {
    array.status[0].level = DiagnosticStatus::STALE;
    array.status[0].message = "No estimate has come yet.";
  } else if (const double waited = steady_seconds() - judged_at_;
             behind() > kBehind || (behind() > 0 && waited > kBehind)) {
    array.status[0].level = DiagnosticStatus::STALE;
    array.status[0].message = fmt::format(
        "Not judged yet: the estimates are {:.1f} s behind the samples, the last came {:.1f} s ago.", behind(), waited);
  }
  diagnostics_.publish(array);
}

void AlarmPublisher::each_second() {
  keep_reference();
  if (kept_changes_ != stage_.changes()) {
    // A call to the master: here and not in the path of an estimate.
    std::vector<std::uint8_t> bytes = to_bytes(before_.with(stage_.report()));
    private_node_.setParam("history", XmlRpc::XmlRpcValue(bytes.data(), static_cast<int>(bytes.size())));
    kept_changes_ = stage_.changes();
  }
  publish();
}

void AlarmPublisher::keep_reference() {
  if (reference_.empty()) return;
  const References learnt = stage_.references();
  if (learnt.stages.size() <= kept_) return;
  try {
    update_references(learnt, reference_);
    kept_ = learnt.stages.size();
    reference_trouble_.clear();
  } catch (const InputError& error) {
    reference_trouble_ = error.what();
  }
}

void AlarmPublisher::tell(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const SequenceCounts& counts = monitor_.counts();
  const bool silent = counts.received == told_.received;
  status.summary(DiagnosticStatus::OK, "estimates arrive");
  status.add("estimates per second", rate_.rate(counts.received));
  tell_counts(counts, told_, status);
  status.add("not understood", bad_);
  status.add("of other stages", other_stage_);
  status.add("samples that an estimator left out", join_.dropped());
  status.add("behind the samples [s]", behind());
  if (bad_ > 0) status.mergeSummary(DiagnosticStatus::WARN, "some estimates do not fit this rig");
  if (!reference_.empty()) status.add("stages with a kept reference", kept_);
  if (!reference_trouble_.empty()) status.mergeSummary(DiagnosticStatus::WARN, reference_trouble_);
  if (silent)
    status.mergeSummary(DiagnosticStatus::WARN,
                        counts.received == 0 ? "no estimate yet" : "no estimate since the last report");
  if (silence_.clock_stands(steady_seconds(), simulated_seconds()))
    status.mergeSummary(DiagnosticStatus::WARN, "/clock stands still: replay is paused or over, silence is not judged");
}

}  // namespace faultline
