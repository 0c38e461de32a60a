#include "nodes/topic_driver.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <ros/ros.h>
#include <nlohmann/json.hpp>

#include "faultline/signal/error.h"
#include "nodes/conversion.h"
#include "nodes/node_main.h"
#include "nodes/rig_input.h"

namespace faultline {
namespace {

using diagnostic_msgs::DiagnosticStatus;

constexpr int kIdle = 100;              // ms without a message after which none is on its way
constexpr std::uint64_t kJudged = 100;  // samples whose median interval tells the period
constexpr double kJump = 1;             // s: stamps that go back further begin anew; disorder on the way is shorter
constexpr double kJumpPeriods = 10;
constexpr double kBagEpoch = 946684800;  // s, 2000-01-01T00:00:00Z, the zero of seconds_of_stamp()

}  // namespace

TopicDriver::TopicDriver(const Datasheet& sheet, const Mapping& mapping, const std::string& made_by, double wait,
                         Listeners& listeners)
    : sheet_(sheet),
      mapping_(mapping),
      assembler_(
          assembly_plan(mapping, sheet, wait),
          [this](double time, std::uint64_t row, const std::vector<double>& values) { deliver(time, row, values); }),
      monitor_(sequence_settings(sheet)),
      check_(sheet.sample_period) {
  for (const MappedChannel& mapped : mapping.channels)
    conversions_.push_back(mapped.conversion(sheet.channels[mapped.channel], mapped.unit));
  sample_.values.resize(sheet.channels.size());
  description_ = node_.advertise<faultline_msgs::RigDescription>("description", 1, true);
  samples_ = listeners.advertise<faultline_msgs::Sample>(node_, "sample");
  description_.publish(to_message(sheet, made_by));
}

TopicDriver::~TopicDriver() {
  stop_ = true;
  if (thread_.joinable()) thread_.join();
}

void TopicDriver::start() {
  thread_ = std::thread([this] {
    try {
      listen();
    } catch (const std::exception& error) {
      const std::lock_guard<std::mutex> lock(mutex_);
      trouble_ = error.what();
    }
    ended_ = true;
  });
}

void TopicDriver::listen() {
  std::string name = ros::this_node::getName();
  name = name.substr(name.find_last_of('/') + 1) + "_topics";
  nlohmann::json request = {{"node", name}, {"time", mapping_.clock}, {"fields", nlohmann::json::array()}};
  for (const MappedChannel& mapped : mapping_.channels) request["fields"].push_back(mapped.from);
  FieldReader reader("read_topic_fields.py", request.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace),
                     mapping_.channels.size());
  while (!stop_) {
    const FieldRecord record = reader.next(kIdle);
    const std::lock_guard<std::mutex> lock(mutex_);
    switch (record.kind) {
      case FieldRecord::Kind::value:
        take(record.field, seconds_of_stamp(record.stamp), record.value);
        break;
      case FieldRecord::Kind::note:
        note_ = record.text;
        break;
      case FieldRecord::Kind::nothing:
        assembler_.settle();
        break;
      case FieldRecord::Kind::end:
        return;
    }
  }
}

void TopicDriver::take(std::size_t signal, double time, double raw) {
  ++values_;
  const double value = std::isfinite(raw) ? conversions_[signal](raw) : std::numeric_limits<double>::quiet_NaN();
  const double jump = std::max(kJump, kJumpPeriods * mapping_.period);
  if (time < assembler_.newest(signal) - jump) {
    assembler_.restart(time + jump);
    ++restarts_;
  }
  switch (assembler_.push(signal, time, value)) {
    case RowAssembler::Taken::yes:
      break;
    case RowAssembler::Taken::late:
      ++late_;
      break;
    case RowAssembler::Taken::backward:
      ++refused_;
      break;
  }
}

void TopicDriver::deliver(double time, std::uint64_t row, const std::vector<double>& values) {
  arrange_row(mapping_, values, sample_.values);
  sample_.time = time + kBagEpoch;
  sample_.sequence = row;
  missing_ += static_cast<std::uint64_t>(
      std::count_if(values.begin(), values.end(), [](double value) { return std::isnan(value); }));
  check_.add(sample_);
  if (!fit(monitor_.observe(row, sample_.time))) return;
  faultline_msgs::Sample message = to_message(sample_, sheet_.rig);
  // As it stands in a bag of ours: no digit is lost to the seconds since 1970.
  message.header.stamp.fromNSec(static_cast<std::uint64_t>(stamp_of_seconds(time)));
  samples_.publish(message);
}

std::string TopicDriver::trouble() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return trouble_;
}

void TopicDriver::tell(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const SequenceCounts counts = monitor_.counts();
  const bool silent = counts.received == told_.received;
  status.summary(DiagnosticStatus::OK, "the stand sends");
  status.add("samples per second", rate_.rate(counts.received));
  tell_counts(counts, told_, status);
  status.add("values received", values_);
  status.add("values missing in samples", missing_);
  status.add("out of order", refused_);
  status.add("too late for their sample", late_);
  status.add("stamps that jumped back", restarts_);
  if (missing_ > missing_told_)
    status.mergeSummaryf(DiagnosticStatus::WARN, "%lu values missing since the last report",
                         static_cast<unsigned long>(missing_ - missing_told_));
  missing_told_ = missing_;
  if (!note_.empty()) status.mergeSummary(DiagnosticStatus::WARN, note_);
  for (std::size_t i = 0; i < mapping_.channels.size(); ++i)
    if (assembler_.silent(i))
      status.mergeSummary(DiagnosticStatus::WARN,
                          fmt::format("'{}': nothing comes from {}", sheet_.channels[mapping_.channels[i].channel].name,
                                      mapping_.channels[i].from));
  const SampleFindings findings = check_.findings();
  if (findings.samples >= kJudged && !period_fits(findings, sheet_.sample_period))
    status.mergeSummaryf(
        DiagnosticStatus::WARN,
        "samples come every %.4g s, the rig's datasheet says %.4g s: say resample: true in the mapping",
        findings.period, sheet_.sample_period);
  if (silent)
    status.mergeSummary(DiagnosticStatus::WARN,
                        counts.received == 0 ? "no sample yet" : "no sample since the last report");
}

}  // namespace faultline
