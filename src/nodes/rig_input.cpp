#include "nodes/rig_input.h"

#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <ros/message_event.h>
#include <boost/function.hpp>

#include "nodes/conversion.h"
#include "nodes/node_main.h"

namespace faultline {
namespace {

constexpr double kDescriptionWait = 2;  // s of wall time
constexpr double kPeriodsAgree = 0.01;
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
      deliver_(std::move(deliver)),
      gate_(sheet, kDescriptionWait, 2 * kQueue, [this](const Sample& sample, double) { take(sample); }),
      monitor_(sequence_settings(sheet)),
      stream_(sheet.sample_period),
      run_start_(sheet.sample_period) {}

void RigInput::start() {
  const ros::TransportHints fast = ros::TransportHints().tcpNoDelay();
  using DescriptionEvent = ros::MessageEvent<const faultline_msgs::RigDescription>;
  using SampleEvent = ros::MessageEvent<const faultline_msgs::Sample>;
  description_ = node_.subscribe<const DescriptionEvent&>(
      "description", 10, boost::function<void(const DescriptionEvent&)>([this](const DescriptionEvent& event) {
        describe(event.getPublisherName(), from_message(*event.getConstMessage()));
      }),
      ros::VoidConstPtr(), fast);
  samples_ = node_.subscribe<const SampleEvent&>(
      "sample", kQueue, boost::function<void(const SampleEvent&)>([this](const SampleEvent& event) {
        if (is_source(event.getPublisherName())) gate_.push(from_message(*event.getConstMessage()), steady_seconds());
      }),
      ros::VoidConstPtr(), fast);
  timer_ = node_.createWallTimer(ros::WallDuration(0.1),
                                 [this](const ros::WallTimerEvent&) { gate_.tick(steady_seconds()); });
}

void RigInput::take(const Sample& sample) {
  run_start_.add(sample);
  // Arrival is not judged here: in replay it has nothing to do with the stamps. The driver does that.
  monitor_.observe(sample.sequence, sample.time);
  stream_.add(sample.sequence, sample.time);
  deliver_(sample);
}

bool RigInput::is_source(const std::string& publisher) {
  if (publisher == source_) return true;
  if (!source_.empty() && samples_.getNumPublishers() > 1) {
    ++foreign_;
    other_ = publisher;
    return false;
  }
  source_ = publisher;
  use_description();
  return true;
}

void RigInput::describe(const std::string& publisher, const Description& description) {
  if (description_.getNumPublishers() < 2) descriptions_.clear();
  descriptions_[publisher] = description;
  if (publisher == described_by_) described_by_.clear();  // it says something new
  use_description();
}

void RigInput::use_description() {
  auto chosen = descriptions_.find(source_);
  if (chosen == descriptions_.end()) chosen = descriptions_.find(described_by_);
  if (chosen == descriptions_.end()) chosen = descriptions_.begin();
  if (chosen == descriptions_.end() || chosen->first == described_by_) return;
  described_by_ = chosen->first;
  run_start_.describe(chosen->second.start);
  gate_.describe(chosen->second);
  if (!gate_.trouble().empty()) ROS_ERROR("%s", gate_.trouble().c_str());
}

std::string RigInput::contradiction() const {
  if (description_.getNumPublishers() < 2) return "";
  const auto used = descriptions_.find(described_by_);
  if (used == descriptions_.end()) return "";
  for (const auto& [publisher, said] : descriptions_) {
    const Description& own = used->second;
    if (said.rig != own.rig || said.names != own.names || said.units != own.units ||
        said.sample_period != own.sample_period)
      return fmt::format("the descriptions of {} and {} contradict each other, that of {} counts; end one of the two",
                         described_by_, publisher, described_by_);
  }
  return "";
}

void RigInput::tell(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const std::uint64_t before = told_.received;
  const SequenceCounts& counts = monitor_.counts();
  status.summary(DiagnosticStatus::OK, "samples arrive");
  status.add("samples per second", rate_.rate(counts.received));
  tell_counts(counts, told_, status);
  status.add("refused", gate_.refused());
  status.add("missed at the start", run_start_.missed());
  status.add("of another publisher", foreign_);
  const auto warn = [&](bool holds, const std::string& words) {
    if (holds) status.mergeSummary(DiagnosticStatus::WARN, words);
  };
  const std::uint64_t missed = run_start_.certain();
  warn(missed > told_missed_, fmt::format("{} samples missed at the start of the run", missed - told_missed_));
  warn(foreign_ > told_foreign_,
       fmt::format("{} sends samples too and is left out, those of {} count; end one of the two", other_, source_));
  warn(gate_.refused() > told_refused_ && !gate_.refusal().empty(), gate_.refusal());
  warn(!stream_.trouble().empty(), stream_.trouble());
  const std::string contradicted = contradiction();
  warn(!contradicted.empty(), contradicted);
  const auto described = descriptions_.find(described_by_);
  if (described != descriptions_.end()) {
    const double period = described->second.sample_period;
    warn(std::abs(period - sheet_.sample_period) > kPeriodsAgree * sheet_.sample_period,
         fmt::format("the description says a sample every {:.4g} s, the rig's datasheet {:.4g} s", period,
                     sheet_.sample_period));
  }
  told_missed_ = missed;
  told_foreign_ = foreign_;
  told_refused_ = gate_.refused();
  if (!gate_.trouble().empty())
    status.mergeSummary(gate_.refusing() ? DiagnosticStatus::ERROR : DiagnosticStatus::WARN, gate_.trouble());
  if (counts.received == before)
    status.mergeSummary(DiagnosticStatus::WARN,
                        counts.received == 0 ? "no sample yet" : "no sample since the last report");
}

}  // namespace faultline
