#include "nodes/alarm_publisher.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include <fmt/format.h>
#include <ros/ros.h>

#include "faultline/signal/error.h"
#include "nodes/conversion.h"
#include "nodes/node_main.h"
#include "nodes/rig_input.h"

namespace faultline {
namespace {

using diagnostic_msgs::DiagnosticStatus;

constexpr double kSentWithin = 0.1;       // s
constexpr double kBehind = 1;             // s of judgements behind samples: what a person at the stand should know
constexpr std::uint64_t kUnjudged = 100;  // samples without a judgement, whatever their stamps say
constexpr double kAwaited = 5;            // s; the longest judgement takes 0.8 s of a processor

}  // namespace

AlarmPublisher::AlarmPublisher(const Datasheet& sheet, double patience, const std::string& history)
    : sheet_(sheet),
      name_(ros::this_node::getNamespace().size() > 1 ? ros::this_node::getNamespace().substr(1) : sheet.rig),
      keeper_(sheet),
      monitor_(sequence_settings(sheet)),
      silence_(patience),
      before_(sheet.rig, history),
      health_(sheet.rig, "alarms", [this](diagnostic_updater::DiagnosticStatusWrapper& status) { tell(status); }) {
  alarms_ = node_.advertise<faultline_msgs::AlarmArray>("alarms", 100, true);
  diagnostics_ = node_.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 100);
  const ros::TransportHints fast = ros::TransportHints().tcpNoDelay();
  const auto take = [this](const auto& message) {
    join_.add(message);
    take_pairs();
  };
  using DetectionsPtr = boost::shared_ptr<const faultline_msgs::Detections>;
  using HypothesesPtr = boost::shared_ptr<const faultline_msgs::Hypotheses>;
  detections_ = node_.subscribe<faultline_msgs::Detections>(
      "detections", kQueue, [take](const DetectionsPtr& message) { take(message); }, ros::VoidConstPtr(), fast);
  hypotheses_ = node_.subscribe<faultline_msgs::Hypotheses>(
      "hypotheses", kQueue, [take](const HypothesesPtr& message) { take(message); }, ros::VoidConstPtr(), fast);
  samples_ = node_.subscribe<faultline_msgs::Sample>(
      "sample", kQueue,
      [this](const boost::shared_ptr<const faultline_msgs::Sample>& message) {
        hear(to_seconds(message->header.stamp));
      },
      ros::VoidConstPtr(), fast);
  end_ = node_.subscribe<std_msgs::Time>("end", 10, [this](const boost::shared_ptr<const std_msgs::Time>& message) {
    run_end_ = to_seconds(message->data);
    if (judged_ == run_end_) publish();
  });
  watch_timer_ = node_.createWallTimer(ros::WallDuration(0.1), [this](const ros::WallTimerEvent&) { watch(); });
  second_timer_ = node_.createWallTimer(ros::WallDuration(1), [this](const ros::WallTimerEvent&) { each_second(); });
  published_changes_ = keeper_.changes();
  publish();
}

void AlarmPublisher::close() {
  if (!ros::ok()) return;
  diagnostic_msgs::DiagnosticArray array = closed_.all(sheet_.rig);
  array.header.stamp = ros::Time::now();
  diagnostics_.publish(array);
  ros::WallDuration(kSentWithin).sleep();  // roscpp sends from a thread of its own, and does not say when it has
}

double AlarmPublisher::simulated_seconds() const {
  return ros::Time::isSimTime() ? ros::Time::now().toSec() : std::numeric_limits<double>::quiet_NaN();
}

void AlarmPublisher::take_pairs() {
  for (bool more = true; more;) {
    double time = 0;
    try {
      const std::optional<Assessment> assessment = join_.next();
      if (!assessment) return;
      keeper_.process(*assessment);
      time = assessment->time;
      monitor_.observe(assessment->sequence, time);
    } catch (const InputError&) {
      ++bad_;
      continue;
    }
    judged_ = time;
    judged_at_ = steady_seconds();
    unjudged_ = 0;
    if (heard_ == 0) silence_.arrived(time, steady_seconds(), simulated_seconds());
    if (keeper_.changes() != published_changes_ || judged_ == run_end_) publish();
  }
}

void AlarmPublisher::hear(double sample_time) {
  heard_ = sample_time;
  heard_at_ = steady_seconds();
  keeper_.heard(sample_time);
  ++unjudged_;
  silence_.arrived(heard_, heard_at_, simulated_seconds());
}

double AlarmPublisher::behind() const { return heard_ > 0 ? std::max(0.0, heard_ - judged_) : 0; }

bool AlarmPublisher::pending() const { return behind() > 0 || unjudged_ > kUnjudged; }

bool AlarmPublisher::awaited() const {
  return pending() && steady_seconds() - std::max(heard_at_, judged_at_) < kAwaited;
}

void AlarmPublisher::watch() {
  const double now = silence_.now(steady_seconds(), simulated_seconds());
  if (std::isnan(now) || awaited() || (heard_ > 0 && heard_ == run_end_)) return;
  keeper_.advance(now);
  if (keeper_.changes() != published_changes_) publish();
}

void AlarmPublisher::publish() {
  published_changes_ = keeper_.changes();
  const AlarmReport report = before_.with(keeper_.report());
  alarms_.publish(to_message(report));
  diagnostic_msgs::DiagnosticArray array = to_diagnostics(report, name_);
  closed_.close(array);
  array.header.stamp = ros::Time::now();
  const double waited = steady_seconds() - judged_at_;
  const bool silent = std::any_of(report.alarms.begin(), report.alarms.end(),
                                  [](const Alarm& alarm) { return alarm.active && alarm.level == AlarmLevel::stale; });
  if (silent && !awaited()) {
    // The verdict says it.
  } else if (monitor_.counts().received == 0) {
    array.status[0].level = DiagnosticStatus::STALE;
    array.status[0].message = "No sample has been judged yet.";
  } else if (behind() > kBehind || (pending() && waited > kBehind)) {
    array.status[0].level = DiagnosticStatus::STALE;
    array.status[0].message = fmt::format(
        "Not judged yet: judgements are {:.1f} s behind the samples, the last came {:.1f} s ago.", behind(), waited);
  }
  diagnostics_.publish(array);
}

void AlarmPublisher::each_second() {
  if (kept_changes_ != keeper_.changes()) {
    // A call to the master: here and not in the path of an estimate.
    std::vector<std::uint8_t> bytes = to_bytes(before_.with(keeper_.report()));
    private_node_.setParam("history", XmlRpc::XmlRpcValue(bytes.data(), static_cast<int>(bytes.size())));
    kept_changes_ = keeper_.changes();
  }
  publish();
}

void AlarmPublisher::tell(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const SequenceCounts& counts = monitor_.counts();
  const bool silent = counts.received == told_.received;
  status.summary(DiagnosticStatus::OK, "judgements arrive");
  status.add("judgements per second", rate_.rate(counts.received));
  tell_counts(counts, told_, status);
  status.add("not understood", bad_);
  status.add("without their other half", join_.dropped());
  status.add("behind the samples [s]", behind());
  if (bad_rise_.since_last(bad_)) status.mergeSummary(DiagnosticStatus::WARN, "some judgements do not fit this rig");
  if (silent)
    status.mergeSummary(DiagnosticStatus::WARN,
                        counts.received == 0 ? "no judgement yet" : "no judgement since the last report");
  if (silence_.clock_stands(steady_seconds(), simulated_seconds()))
    status.mergeSummary(DiagnosticStatus::WARN, "/clock stands still: replay is paused or over, silence is not judged");
}

}  // namespace faultline
