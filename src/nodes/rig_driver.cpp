#include "nodes/rig_driver.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <ros/ros.h>

#include "faultline/signal/error.h"
#include "faultline/signal/text.h"
#include "nodes/conversion.h"
#include "nodes/conversion_lcm.h"
#include "nodes/lcm_name.h"
#include "nodes/node_main.h"
#include "nodes/rig_input.h"

namespace faultline {
namespace {

using diagnostic_msgs::DiagnosticStatus;

constexpr double kDescriptionWait = 1.5;  // s: a DAQ sends one a second
constexpr std::size_t kOthers = 8;        // names worth telling
constexpr std::uint64_t kTwice = 4;       // a quarter of the samples is no chance

}  // namespace

RigDriver::RigDriver(const Datasheet& sheet, const std::string& lcm_name, const std::string& made_by,
                     Listeners& listeners)
    : sheet_(sheet),
      sample_channel_(lcm_channel(lcm_name, "sample")),
      description_channel_(lcm_channel(lcm_name, "description")),
      gate_(sheet, kDescriptionWait, 2 * kQueue,
            [this](const Sample& sample, double arrival) { deliver(sample, arrival); }),
      senders_(sheet.sample_period),
      monitor_(sequence_settings(sheet)) {
  description_ = node_.advertise<faultline_msgs::RigDescription>("description", 1, true);
  samples_ = listeners.advertise<faultline_msgs::Sample>(node_, "sample");
  description_.publish(to_message(sheet, made_by));
}

void RigDriver::take(const std::string& channel, const void* data, int size, double arrival) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (channel == sample_channel_) {
    faultline_lcm::sample_t message;
    if (!decode(data, size, message)) {
      ++undecodable_;
      return;
    }
    try {
      gate_.push(from_lcm(message), arrival);
    } catch (const InputError& error) {
      ++unfit_;
      last_unfit_ = error.what();
    }
  } else if (channel == description_channel_) {
    faultline_lcm::rig_description_t message;
    if (!decode(data, size, message)) {
      ++undecodable_;
      return;
    }
    const std::string before = gate_.trouble();
    gate_.describe(from_lcm(message));
    if (!gate_.trouble().empty() && gate_.trouble() != before) ROS_ERROR("%s", gate_.trouble().c_str());
  } else {
    note_other(channel, data, size);
  }
}

void RigDriver::note_other(const std::string& channel, const void* data, int size) {
  const std::string name = lcm_name_of(channel, "description");
  if (name.empty() || others_.size() >= kOthers || others_.count(name) > 0) return;
  faultline_lcm::rig_description_t message;
  if (decode(data, size, message) && message.rig == sheet_.rig) others_.insert(name);
}

std::string RigDriver::no_sample() const {
  std::string words = "no sample yet on LCM channel " + sample_channel_;
  if (!others_.empty())
    words += printable(
        fmt::format("; rigs of this kind go by the name of {} there: give one as lcm_name", fmt::join(others_, ", ")));
  return words;
}

void RigDriver::flush(double arrival) {
  const std::lock_guard<std::mutex> lock(mutex_);
  gate_.tick(arrival);
}

void RigDriver::deliver(const Sample& sample, double arrival) {
  if (!senders_.own(sample.sequence, sample.time, arrival)) return;
  if (!fit(monitor_.observe(sample.sequence, sample.time, arrival))) return;
  samples_.publish(to_message(sample, sheet_.rig));
  last_time_ = sample.time;
  ++published_;
}

double RigDriver::last_time() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return last_time_;
}

std::uint64_t RigDriver::published() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return published_;
}

std::string RigDriver::trouble() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return gate_.trouble().empty() ? gate_.refusal() : gate_.trouble();
}

void RigDriver::tell(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const SequenceCounts counts = monitor_.counts();
  const SequenceCounts before = told_;
  const bool silent = counts.received == told_.received;
  status.summary(DiagnosticStatus::OK, "the DAQ sends");
  status.add("samples per second", rate_.rate(counts.received));
  status.add("published", published_);
  tell_counts(counts, told_, status);
  status.add("of another sender", senders_.foreign());
  if (senders_.foreign() > told_foreign_)
    status.mergeSummary(DiagnosticStatus::WARN,
                        fmt::format("two senders on LCM channel {}: the one that was heard first counts, {} samples of "
                                    "the other are left out; end one, or give each a name of its own (lcm_name)",
                                    sample_channel_, senders_.foreign() - told_foreign_));
  else if (kTwice * (counts.duplicate - before.duplicate) > counts.received - before.received)
    status.mergeSummary(DiagnosticStatus::WARN,
                        fmt::format("samples come twice on LCM channel {}: two senders with the same numbers, or a "
                                    "network that doubles them; end one, or give each a name of its own (lcm_name)",
                                    sample_channel_));
  told_foreign_ = senders_.foreign();
  status.add("refused", gate_.refused());
  status.add("undecodable", undecodable_);
  status.add("unfit", unfit_);
  if (undecodable_rise_.since_last(undecodable_))
    status.mergeSummary(DiagnosticStatus::WARN,
                        "some LCM messages do not decode: does the DAQ use msg/lcm of this version?");
  if (unfit_rise_.since_last(unfit_)) status.mergeSummary(DiagnosticStatus::WARN, last_unfit_);
  if (gate_.refused() > told_refused_ && !gate_.refusal().empty())
    status.mergeSummary(DiagnosticStatus::WARN, gate_.refusal());
  told_refused_ = gate_.refused();
  if (!gate_.trouble().empty())
    status.mergeSummary(gate_.refusing() ? DiagnosticStatus::ERROR : DiagnosticStatus::WARN, gate_.trouble());
  if (silent)
    status.mergeSummary(DiagnosticStatus::WARN, counts.received == 0 ? no_sample() : "no sample since the last report");
}

}  // namespace faultline
