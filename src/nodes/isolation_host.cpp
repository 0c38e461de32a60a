#include "nodes/isolation_host.h"

#include <algorithm>
#include <filesystem>

#include <ros/ros.h>

#include "faultline/signal/error.h"
#include "nodes/assessment_messages.h"
#include "nodes/conversion.h"
#include "nodes/rig_input.h"

namespace faultline {
namespace {

using diagnostic_msgs::DiagnosticStatus;

// Of those in a file, how many are not of estimators.
std::size_t own_references(const References& references, const Datasheet& sheet) {
  return static_cast<std::size_t>(
      std::count_if(references.stages.begin(), references.stages.end(), [&](const StageReference& kept) {
        return std::none_of(sheet.estimators.begin(), sheet.estimators.end(),
                            [&](const StageSpec& spec) { return spec.name == kept.stage; });
      }));
}

}  // namespace

IsolationHost::IsolationHost(const Datasheet& sheet, const std::string& reference, Listeners listeners)
    : sheet_(sheet),
      stage_(sheet),
      join_(occasional_stages(sheet)),
      monitor_(sequence_settings(sheet)),
      reference_(reference),
      health_(sheet.rig, "detectors and isolators",
              [this](diagnostic_updater::DiagnosticStatusWrapper& status) { tell(status); }) {
  if (!reference_.empty() && std::filesystem::exists(reference_)) {
    const References references = read_references(reference_, sheet.rig);
    stage_.restore(references);
    kept_ = own_references(references, sheet);
  }
  detections_ = listeners.advertise<faultline_msgs::Detections>(node_, "detections");
  hypotheses_ = listeners.advertise<faultline_msgs::Hypotheses>(node_, "hypotheses");
  listeners.wait();
  estimates_ = node_.subscribe<faultline_msgs::Estimate>(
      "estimate", kQueue, [this](const boost::shared_ptr<const faultline_msgs::Estimate>& message) { take(*message); },
      ros::VoidConstPtr(), ros::TransportHints().tcpNoDelay());
  second_timer_ = node_.createWallTimer(ros::WallDuration(1), [this](const ros::WallTimerEvent&) { keep_reference(); });
}

void IsolationHost::take(const faultline_msgs::Estimate& message) {
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
  const double time = estimate.time;
  const std::uint64_t sequence = estimate.sequence;
  const auto stage = static_cast<std::size_t>(from - sheet_.estimators.begin());
  if (!join_.add(stage, std::move(estimate), estimates_of_sample_)) return;
  monitor_.observe(sequence, time);
  const Assessment& assessment = stage_.process(estimates_of_sample_);
  detections_.publish(detections_of(assessment, sheet_.rig));
  hypotheses_.publish(hypotheses_of(assessment, sheet_.rig));
}

void IsolationHost::keep_reference() {
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

void IsolationHost::tell(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const SequenceCounts& counts = monitor_.counts();
  const bool silent = counts.received == told_.received;
  status.summary(DiagnosticStatus::OK, "estimates arrive");
  status.add("estimates per second", rate_.rate(counts.received));
  tell_counts(counts, told_, status);
  status.add("not understood", bad_);
  status.add("of other stages", other_stage_);
  status.add("samples that an estimator left out", join_.dropped());
  if (bad_rise_.since_last(bad_)) status.mergeSummary(DiagnosticStatus::WARN, "some estimates do not fit this rig");
  if (!reference_.empty()) status.add("stages with a kept reference", kept_);
  if (!reference_trouble_.empty()) status.mergeSummary(DiagnosticStatus::WARN, reference_trouble_);
  if (silent)
    status.mergeSummary(DiagnosticStatus::WARN,
                        counts.received == 0 ? "no estimate yet" : "no estimate since the last report");
}

}  // namespace faultline
