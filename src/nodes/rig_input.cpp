#include "nodes/rig_input.h"

#include <limits>

#include "nodes/conversion.h"
#include "nodes/node_main.h"

namespace faultline {
namespace {

constexpr double kDescriptionWait = 2;  // s of wall time
using diagnostic_msgs::DiagnosticStatus;

}  // namespace

SequenceSettings sequence_settings(const Datasheet& sheet) {
  SequenceSettings settings;
  settings.period = sheet.sample_period;
  return settings;
}

void tell_counts(const SequenceCounts& counts, SequenceCounts& told,
                 diagnostic_updater::DiagnosticStatusWrapper& status) {
  status.add("received", counts.received);
  status.add("lost", counts.lost);
  status.add("duplicate", counts.duplicate);
  status.add("out of order", counts.out_of_order);
  status.add("late", counts.late);
  status.add("restarts", counts.restarts);
  if (counts.lost > told.lost)
    status.mergeSummaryf(DiagnosticStatus::WARN, "%lu samples lost since the last report",
                         static_cast<unsigned long>(counts.lost - told.lost));
  told = counts;
}

RigInput::RigInput(const Datasheet& sheet, std::function<void(const Sample&)> deliver)
    : sheet_(sheet),
      gate_(sheet, kDescriptionWait, 2 * kQueue,
            [this, deliver](const Sample& sample, double) {
              // Arrival is not judged here: in replay it has nothing to do with the stamps. The driver does that.
              monitor_.observe(sample.sequence, sample.time);
              deliver(sample);
            }),
      monitor_(sequence_settings(sheet)) {}

void RigInput::start() {
  const ros::TransportHints fast = ros::TransportHints().tcpNoDelay();
  description_ = node_.subscribe<faultline_msgs::RigDescription>(
      "description", 10,
      [this](const boost::shared_ptr<const faultline_msgs::RigDescription>& message) {
        gate_.describe(from_message(*message));
        if (!gate_.trouble().empty()) ROS_ERROR("%s", gate_.trouble().c_str());
      },
      ros::VoidConstPtr(), fast);
  samples_ = node_.subscribe<faultline_msgs::Sample>(
      "sample", kQueue,
      [this](const boost::shared_ptr<const faultline_msgs::Sample>& message) {
        gate_.push(from_message(*message), steady_seconds());
      },
      ros::VoidConstPtr(), fast);
  timer_ = node_.createWallTimer(ros::WallDuration(0.1),
                                 [this](const ros::WallTimerEvent&) { gate_.tick(steady_seconds()); });
}

void RigInput::tell(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const std::uint64_t before = told_.received;
  const SequenceCounts& counts = monitor_.counts();
  status.summary(DiagnosticStatus::OK, "samples arrive");
  status.add("samples per second", rate_.rate(counts.received));
  tell_counts(counts, told_, status);
  status.add("refused", gate_.refused());
  if (!gate_.trouble().empty())
    status.mergeSummary(gate_.refusing() ? DiagnosticStatus::ERROR : DiagnosticStatus::WARN, gate_.trouble());
  if (counts.received == before)
    status.mergeSummary(DiagnosticStatus::WARN,
                        counts.received == 0 ? "no sample yet" : "no sample since the last report");
}

}  // namespace faultline
